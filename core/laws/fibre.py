"""Fibres along one direction a: a law plus  k/8 (a.C a - 1)^2,  k the extra Young's modulus along a at small strain, kPa."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Kernel, Law, PointValues


def with_fibres(law: Law, a: FloatArray) -> Law:
    """The law with one more parameter, k, for fibres along the unit vector a (3,)."""
    n = len(law.parameters)

    def kernel(F: FloatArray, p: FloatArray, out: PointValues, order: int) -> None:
        W, _, P, _, A, _ = out
        law.kernel(F, np.ascontiguousarray(p[:, :n]), out, order)
        k = p[:, n, None]
        f = F @ a
        stretch = (f * f).sum(axis=-1) - 1.0
        W += 0.125 * k * stretch**2
        if order >= 1:
            P += (0.5 * k * stretch)[..., None, None] * f[..., :, None] * a
        if order >= 2:
            fa = (f[..., :, None] * a).reshape(*stretch.shape, 9)
            A += k[..., None, None] * fa[..., :, None] * fa[..., None, :]
            A += (0.5 * k * stretch)[..., None, None] * np.kron(np.eye(3), np.outer(a, a))

    x, y, z = a.tolist()
    whole: Kernel = kernel
    return Law(
        f"{law.name}, fibres along {x:.6f} {y:.6f} {z:.6f}",
        (*law.parameters, "k"),
        whole,
        lambda p: law.kappa_of(p[:, :n]),
        lambda p: law.shear_modulus_of(p[:, :n]),
        law.needs_positive_jacobian,
    )
