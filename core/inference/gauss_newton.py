"""Levenberg-Marquardt in log-stiffness with direct sensitivities (du/dmu of Eq 20 of Yang & Lin)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import FloatArray

# theta (t,) -> whitened residual (q,) and Jacobian (q, t); None where the model has no answer.
Linearise = Callable[[FloatArray], tuple[FloatArray, FloatArray] | None]


@dataclass(frozen=True, eq=False)
class GaussNewtonResult:
    """theta (t,) at the smallest misfit found, residual (q,) and Jacobian (q, t) there, misfit of every accepted step."""

    theta: FloatArray
    residual: FloatArray
    jacobian: FloatArray
    history: list[float] = field(default_factory=list)
    evaluations: int = 0
    converged: bool = False

    @property
    def misfit(self) -> float:
        """Squared length of the residual."""
        return float(self.residual @ self.residual)


def gauss_newton(
    linearise: Linearise,
    start: FloatArray,
    bounds: FloatArray,
    tolerance: float = 2e-3,
    max_evaluations: int = 25,
) -> GaussNewtonResult | None:
    """Minimise |r(theta)|^2 within bounds (t, 2); ends when a step is below `tolerance` (in ln G). None if the start cannot be solved."""
    theta = np.clip(start, bounds[:, 0], bounds[:, 1])
    here = linearise(theta)
    if here is None:
        return None
    damping, evaluations = 1e-3, 1
    history = [float(here[0] @ here[0])]
    while evaluations < max_evaluations:
        step = _bounded_step(theta, *here, damping, bounds)
        if np.abs(step).max(initial=0.0) < tolerance:
            return GaussNewtonResult(theta, *here, history, evaluations, True)
        there = linearise(theta + step)
        evaluations += 1
        if there is not None and there[0] @ there[0] < history[-1]:
            theta, here = theta + step, there
            history.append(float(here[0] @ here[0]))
            damping = max(0.2 * damping, 1e-8)
        else:
            damping = 8.0 * max(damping, 1e-3)
            if damping > 1e6:
                break
    return GaussNewtonResult(theta, *here, history, evaluations, damping > 1e6)


def _bounded_step(
    theta: FloatArray, residual: FloatArray, J: FloatArray, damping: float, bounds: FloatArray, longest: float = 1.2
) -> FloatArray:
    """Damped step that respects the bounds: parameters that press against a bound are held and the rest solved again."""
    gradient = J.T @ residual
    H = J.T @ J
    step = np.zeros_like(theta)
    free = np.ones(len(theta), dtype=bool)
    for _ in range(len(theta)):
        if not free.any():
            break
        step[:] = 0.0
        A = H[np.ix_(free, free)]
        step[free] = -np.linalg.solve(A + damping * np.diag(np.diag(A) + 1e-12), gradient[free])
        pressing = free & (
            ((theta <= bounds[:, 0] + 1e-9) & (step < 0.0)) | ((theta >= bounds[:, 1] - 1e-9) & (step > 0.0))
        )
        if not pressing.any():
            break
        free &= ~pressing
        step[~free] = 0.0
    return np.clip(theta + np.clip(step, -longest, longest), bounds[:, 0], bounds[:, 1]) - theta
