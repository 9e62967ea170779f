"""Kernel of a wall's normal motion by type-II maximum likelihood (Rasmussen & Williams 2006, 5.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.observe.wall_rigid_and_growth import WallRigidModes


@dataclass(frozen=True)
class Kernel:
    """Squared-exponential kernel. length : correlation length, mm. size : standard deviation along the normal, mm."""

    length: float
    size: float


def likeliest(
    X: FloatArray, out: FloatArray, normal: FloatArray, shift: FloatArray, noise: FloatArray, rigid: WallRigidModes
) -> Kernel:
    """The kernel that maximises the marginal likelihood of motions shift (q,) mm along `normal` (q, 3), at points X (q,
    3) mm.

    normal, out (q, 3) : unit normals, deformed and at rest. noise (q, q) mm2 : covariance of shift. Kernels of
    `whole.options` are compared. Raises LinAlgError when noise is not positive definite.
    """
    options = rigid.options
    squared = cdist(X, X) ** 2
    turned, larger = (normal * out).sum(axis=1), (normal * rigid.growth(X)).sum(axis=1)
    across = normal @ rigid.axes
    straight, other = np.outer(turned, turned), across @ across.T
    known = noise + rigid.translation_mm**2 * rigid.correlation(X, X) * other + np.outer(larger, larger)
    best = (-np.inf, Kernel(options.lengths_mm[0], options.sizes_mm[0]))
    for length in options.lengths_mm:
        near = np.exp(-0.5 * squared / length**2)
        rest = known + options.sideways_mm**2 * near * other
        for size in options.sizes_mm:
            L = np.linalg.cholesky(size**2 * near * straight + rest)
            white = solve_triangular(L, shift, lower=True, check_finite=False)
            likelihood = -0.5 * float(white @ white) - float(np.log(np.diag(L)).sum())
            if likelihood > best[0]:
                best = (likelihood, Kernel(length, size))
    return best[1]
