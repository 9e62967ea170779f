"""Optimum of the plain model by Gauss-Newton from several starts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.inference.gauss_newton import gauss_newton
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.joint_states import JointLinearisation, JointModel
from palpate.core.worker.progress import Progress, silent

# Largest difference of ln G at which the optima of two starts count as the same.
SAME_OPTIMUM = 0.05


@dataclass(frozen=True, eq=False)
class Optimum:
    """linearisation : at the best optimum. ends (s, t) : theta at the end of every start that could be solved.

    history : squared length of the weighted residual after every accepted step from the best start.
    """

    linearisation: JointLinearisation
    ends: FloatArray
    history: list[float] = field(default_factory=list)

    def agree(self, stiffness: slice) -> bool:
        """Whether all starts end at the same ln G; stiffness : its rows of theta."""
        return bool((np.abs(self.ends - self.linearisation.theta)[:, stiffness] < SAME_OPTIMUM).all())


def solved(model: JointModel, theta: FloatArray, near: JointLinearisation | None) -> JointLinearisation:
    """The plain model at theta (t,). Raises ConvergenceError when it has no equilibrium."""
    linearisation = model.plain(theta, near)
    if linearisation is None:
        raise ConvergenceError(
            "the rest anatomy cannot be deformed into what the other scans show; look at the contours of bladder and "
            "rectum, or mesh more finely"
        )
    return linearisation


def best_of(
    model: JointModel,
    weighting: Weighting,
    starts: FloatArray,
    near: JointLinearisation,
    progress: Progress = silent,
) -> Optimum:
    """Gauss-Newton from every start (s, t), the first equilibrium continued from `near`; the best point of all.

    Raises ConvergenceError when no start can be solved.
    """
    best: tuple[float, JointLinearisation, list[float]] | None = None
    ends = []
    for k, start in enumerate(starts):
        path = _Path(model, weighting, near, _of_start(progress, k, len(starts)))
        fit = gauss_newton(path.linearise, start, model.bounds)
        if fit is None or path.best is None:
            continue
        ends.append(fit.theta)
        if best is None or path.lowest < best[0]:
            best = path.lowest, path.best, list(fit.history)
    if best is None:
        raise ConvergenceError("no start of Gauss-Newton could be solved; look at the mesh and at the contours")
    # Lets the walls settle further.
    return Optimum(solved(model, best[1].theta, best[1]), np.array(ends), best[2])


def _of_start(progress: Progress, k: int, starts: int) -> Callable[[int], None]:
    """Progress of start k; the number of its equilibria is unknown, so that its fraction approaches 1."""
    return lambda n: progress(
        (k + n / (n + 6.0)) / starts, f"Gauss-Newton, start {k + 1} of {starts}, equilibrium {n + 1}"
    )


class _Path:
    """Linearisations along a path of thetas, each continued from the one before. best : that of the lowest misfit."""

    def __init__(
        self, model: JointModel, weighting: Weighting, near: JointLinearisation, told: Callable[[int], None]
    ) -> None:
        self._model, self._weighting, self._here, self._told = model, weighting, near, told
        self._solved = 0
        self.best: JointLinearisation | None = None
        self.lowest = np.inf

    def linearise(self, theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Weighted residual (n,) and its derivative (n, t) at theta (t,); None where there is no equilibrium."""
        self._told(self._solved)
        self._solved += 1
        linearisation = self._model.plain(theta, self._here)
        if linearisation is None:
            return None
        self._here = linearisation
        residual = self._weighting.whiten(linearisation.residual)
        if residual @ residual < self.lowest:
            self.lowest, self.best = float(residual @ residual), linearisation
        return residual, self._weighting.whiten(linearisation.in_theta)
