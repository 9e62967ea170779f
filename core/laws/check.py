"""The derivative check every law passes through: stress against energy, tangent against stress, linearity in parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.laws.base import Law


@dataclass(frozen=True)
class DerivativeErrors:
    """Largest errors over the sample, each relative to the largest entry of its own kind at the same F.

    stress and tangent against finite differences, asymmetry of the tangent, departure of psi from linearity in p (over max psi).
    """

    stress: float
    tangent: float
    asymmetry: float
    parameter_linearity: float


def random_deformation_gradients(n: int, seed: int, stretch: tuple[float, float] = (0.6, 1.6)) -> FloatArray:
    """n random F (n, 3, 3) = R1 diag(stretches) R2 with det F > 0 and arbitrary rotations."""
    rng = np.random.default_rng(seed)
    rotations = [np.linalg.qr(rng.normal(size=(n, 3, 3)))[0] for _ in range(2)]
    rotations = [R * np.sign(np.linalg.det(R))[:, None, None] for R in rotations]
    return np.einsum("nij,nj,njk->nik", rotations[0], rng.uniform(*stretch, size=(n, 3)), rotations[1])


def derivative_errors(law: Law, p: FloatArray, F: FloatArray) -> DerivativeErrors:
    """Compare the law's derivatives with Richardson-extrapolated central differences at F (n, 3, 3), parameters p (k,)."""
    stress, tangent = law.stress(F, p).reshape(-1, 9), law.tangent(F, p)
    stress_fd = np.stack([_difference(lambda X: law.energy(X, p), F, k) for k in range(9)], axis=-1)
    tangent_fd = np.stack([_difference(lambda X: law.stress(X, p).reshape(-1, 9), F, k) for k in range(9)], axis=-1)
    q = 1.7 * p + 0.3
    size_P, size_A = np.abs(stress).max(axis=1), np.abs(tangent).max(axis=(1, 2))
    linear = law.energy(F, p + q) - law.energy(F, p) - law.energy(F, q)
    return DerivativeErrors(
        stress=float((np.abs(stress - stress_fd).max(axis=1) / size_P).max()),
        tangent=float((np.abs(tangent - tangent_fd).max(axis=(1, 2)) / size_A).max()),
        asymmetry=float((np.abs(tangent - np.swapaxes(tangent, 1, 2)).max(axis=(1, 2)) / size_A).max()),
        parameter_linearity=float(np.abs(linear).max() / np.abs(law.energy(F, p + q)).max()),
    )


def _difference(f: Callable[[FloatArray], FloatArray], F: FloatArray, k: int, h: float = 2e-3) -> FloatArray:
    """Derivative of f in component k of F by central differences of eighth order (truncation ~h^8, round-off ~1e-16/h)."""
    step = np.zeros((3, 3))
    step[k // 3, k % 3] = h
    weights = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
    terms = [w * (f(F + (n + 1) * step) - f(F - (n + 1) * step)) for n, w in enumerate(weights)]
    return np.asarray(np.sum(terms, axis=0) / h, dtype=np.float64)
