"""The derivative check every law passes through: stress against energy, tangent against stress, linearity in parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.core.laws.base import FloatArray, Law


@dataclass(frozen=True)
class DerivativeErrors:
    """Largest relative errors over the sample: stress, tangent, tangent asymmetry, departure of psi from linearity in p."""

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
    scale = float(np.abs(law.tangent(F, p)).max(axis=(1, 2)).mean())
    stress, tangent = law.stress(F, p).reshape(-1, 9), law.tangent(F, p)
    stress_fd = np.stack([_difference(lambda X: law.energy(X, p), F, k) for k in range(9)], axis=-1)
    tangent_fd = np.stack([_difference(lambda X: law.stress(X, p).reshape(-1, 9), F, k) for k in range(9)], axis=-1)
    q = 1.7 * p + 0.3
    linear = law.energy(F, p + q) - law.energy(F, p) - law.energy(F, q)
    return DerivativeErrors(
        stress=float(np.abs(stress - stress_fd).max() / scale),
        tangent=float(np.abs(tangent - tangent_fd).max() / scale),
        asymmetry=float(np.abs(tangent - np.swapaxes(tangent, 1, 2)).max() / scale),
        parameter_linearity=float(np.abs(linear).max() / np.abs(law.energy(F, p + q)).max()),
    )


def _difference(f: Callable[[FloatArray], FloatArray], F: FloatArray, k: int, h: float = 2e-3) -> FloatArray:
    """Derivative of f in component k of F by central differences of eighth order (truncation ~h^8, round-off ~1e-16/h)."""
    step = np.zeros((3, 3))
    step[k // 3, k % 3] = h
    weights = (4.0 / 5.0, -1.0 / 5.0, 4.0 / 105.0, -1.0 / 280.0)
    return sum(w * (f(F + (n + 1) * step) - f(F - (n + 1) * step)) for n, w in enumerate(weights)) / h
