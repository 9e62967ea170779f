"""Stiffness and rim forces with which a figure passes through drawn keyframes, by Gauss-Newton on the outlines' distance.

The residual is the distance of Eqs 11 to 13 with a sign and in both directions: the figure's rim from the drawn line and the line
from the rim. All keyframes share the stiffness, each has forces of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.identify.gauss_newton import GaussNewtonResult, gauss_newton
from palpate.core.sketch.figure import Figure
from palpate.core.sketch.outline import hausdorff
from palpate.core.sketch.residual import CORRELATION, Target, residual_of
from palpate.core.worker.progress import Progress, silent

FloatArray = NDArray[np.float64]

# A keyframe is hit when no part of the outlines is further away than this, in figure sizes.
HIT = 0.02
# Ratios of stiffness looked for, and forces in their unit: the last only keeps apart what the outlines do not tell.
RATIO_BOUNDS = (np.log(1.0 / 50.0), np.log(50.0))
_FORCE_SD, _FORCE_BOUND = 60.0, 300.0
# What is thought of a ratio before anything is drawn: within a factor of ten, about (standard deviation of ln).
RATIO_SD = 2.3
# The keyframe is approached in so many stages at first, point to point, with the stiffness left alone.
_STAGES = (0.34, 0.67, 1.0)
_FEW = 6
# The rim is on the wrong part of a line when its points are this far from their partners in the mean, in figure sizes.
_ASTRAY = 0.3
# Ratios (ln) that fits up to this degree of the forces are begun from.
_STARTS, _STARTED_ANEW = (0.0, -1.5, 1.5), 1


@dataclass(frozen=True)
class FitOptions:
    """line_error : standard deviation of the drawn lines, in figure sizes. evaluations : most, of one Gauss-Newton run."""

    line_error: float = 0.004
    evaluations: int = 30


@dataclass(frozen=True, eq=False)
class Fit:
    """theta (P - 1,) = ln of stiffness ratios; forces : (k, r) coefficients of each keyframe; states, their equilibria.

    misfit : squared whitened residual of the outlines. looks : independent looks at them. covariance (P - 1, P - 1) of theta.
    goals : (k, q, 3) mm, where springs of `spring` (see `Figure.loaded`) pull the rim's points beside those forces; None where the
    forces were enough, see `closing`.
    """

    theta: FloatArray
    forces: FloatArray
    states: tuple[Equilibrium, ...]
    misfit: float
    looks: float
    covariance: FloatArray
    degree: int
    solves: int
    converged: bool
    goals: FloatArray | None = None
    spring: float = 0.0

    @property
    def score(self) -> float:
        """Schwarz's criterion: misfit plus what every force coefficient costs."""
        return self.misfit + self.forces.size * float(np.log(self.looks))


@dataclass
class _Walk:
    """Linearises the residual along Gauss-Newton's path; every equilibrium starts from the one before."""

    figure: Figure
    targets: tuple[Target, ...]
    basis: FloatArray
    options: FitOptions
    share: float | None
    fixed: FloatArray | None = None  # theta, where only forces are looked for
    last: list[State | None] = field(default_factory=list)
    best: tuple[Equilibrium, ...] = ()
    lowest: float = np.inf
    solves: int = 0

    def split(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """theta (P - 1,) and coefficients (k, r)."""
        n = 0 if self.fixed is not None else len(self.figure.parts) - 1
        return (x[:n] if self.fixed is None else self.fixed), x[n:].reshape(len(self.targets), -1)

    def __call__(self, x: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        theta, forces = self.split(x)
        rows, jacobians, found = [], [], []
        for k, target in enumerate(self.targets):
            end = self.figure.solve(theta, np.tensordot(forces[k], self.basis, 1), self.last[k])
            self.solves += 1
            if not end.converged or self._elsewhere(end, target):
                return None
            found.append(end)
            moves = self.figure.sensitivities(theta, end, self.basis)
            residual, jacobian = residual_of(self.figure, end, moves, target, self.share, self.options.line_error)
            rows.append(residual)
            jacobians.append(jacobian)
        self.last = [State(e.u, e.p) for e in found]
        residual, jacobian = self._stacked(rows, jacobians, x)
        if residual @ residual < self.lowest:
            self.lowest, self.best = float(residual @ residual), tuple(found)
        return residual, jacobian

    def _elsewhere(self, end: Equilibrium, target: Target) -> bool:
        """Whether the figure has turned over or snapped to where the line is met by other parts of the rim."""
        off = np.linalg.norm(self.figure.rim_at(end.u).points - target.partners, axis=1)
        return self.share is None and float(off.mean()) > _ASTRAY * self.figure.outline.size

    def _stacked(self, rows: list[FloatArray], parts: list[FloatArray], x: FloatArray) -> tuple[FloatArray, FloatArray]:
        n, r = len(self.figure.parts) - 1, len(self.basis)
        shown = 0 if self.fixed is not None else n
        jacobian = np.zeros((sum(map(len, rows)), shown + r * len(rows)))
        start = 0
        for k, part in enumerate(parts):
            stop = start + len(part)
            jacobian[start:stop, :shown] = part[:, :shown]
            jacobian[start:stop, shown + k * r : shown + (k + 1) * r] = part[:, n:]
            start = stop
        prior = np.diag(np.where(np.arange(len(x)) < shown, 1.0 / RATIO_SD, 1.0 / _FORCE_SD))
        return np.concatenate([*rows, prior @ x]), np.vstack([jacobian, prior])


def fit_degree(
    figure: Figure,
    targets: tuple[Target, ...],
    degree: int,
    start: Fit | FloatArray | None = None,
    options: FitOptions | None = None,
    fixed: FloatArray | None = None,
) -> Fit:
    """Gauss-Newton at one degree of the force polynomials.

    start : a fit of a lower degree to go on from, or theta (P - 1,) to begin with. fixed : theta to keep, forces alone are
    looked for. Raises ConvergenceError when not even the start has an equilibrium.
    """
    options = options or FitOptions()
    basis = figure.force_basis(degree)
    n = len(figure.parts) - 1
    theta = np.zeros(n) if start is None else start.theta if isinstance(start, Fit) else start
    coefficients = np.zeros((len(targets), len(basis)))
    last: list[State | None] = [None] * len(targets)
    stages: tuple[float | None, ...] = (*_STAGES, None)
    if isinstance(start, Fit):
        coefficients[:, : start.forces.shape[1]] = start.forces
        last, stages = [State(e.u, e.p) for e in start.states], (None,)
    solves = 0
    for share in stages:
        kept = fixed if share is None else theta
        walk = _Walk(figure, targets, basis, options, share, kept, last)
        x = np.concatenate([theta if kept is None else [], coefficients.ravel()])
        most = options.evaluations if share is None else _FEW
        result = gauss_newton(walk, x, _bounds(walk, len(x)), max_evaluations=most)
        solves += walk.solves
        if result is None:
            raise ConvergenceError("the figure has no equilibrium near its keyframes; draw them nearer to each other")
        theta, coefficients = walk.split(result.theta)
        last = [State(e.u, e.p) for e in walk.best]
    assert result is not None
    return _summed(figure, targets, result, walk, degree, solves)


def fit_keyframes(
    figure: Figure,
    targets: tuple[Target, ...],
    options: FitOptions | None = None,
    highest: int = 3,
    progress: Progress = silent,
) -> Fit:
    """The fit with the fewest force coefficients that the drawn lines ask for (Schwarz 1978, Estimating the dimension of a model).

    One that hits every keyframe within HIT everywhere is preferred to any that does not. Low degrees are begun from several ratios
    of stiffness, higher ones go on from the one before.
    Raises ConvergenceError when no degree has an equilibrium near the keyframes.
    """
    best: Fit | None = None
    fit: Fit | None = None
    lowest = (True, np.inf)
    for degree in range(highest + 1):
        progress(degree / (highest + 1), f"forces of degree {degree}")
        fit = _better(figure, targets, degree, fit, options)
        if fit is None:
            continue
        rank = not hits(figure, targets, fit), fit.score
        if best is None or rank < lowest:
            best, lowest = fit, rank
        elif not lowest[0] and fit.degree > best.degree + 1:
            break
    if best is None:
        raise ConvergenceError("the figure has no equilibrium near its keyframes; draw them nearer to each other")
    return best


def hits(figure: Figure, targets: tuple[Target, ...], fit: Fit) -> bool:
    """Whether the rim passes within HIT of every keyframe's line, and the line within HIT of the rim."""
    size = figure.outline.size
    ends = zip(fit.states, targets, strict=True)
    return all(hausdorff(figure.rim_at(end.u), target.outline) < HIT * size for end, target in ends)


def _better(
    figure: Figure, targets: tuple[Target, ...], degree: int, before: Fit | None, options: FitOptions | None
) -> Fit | None:
    """The best fit of one degree from all its starts; None where none has an equilibrium."""
    starts: list[Fit | FloatArray] = [] if before is None else [before]
    n = len(figure.parts) - 1
    if degree <= _STARTED_ANEW:
        starts += [np.full(n, at) for at in (_STARTS if n else (0.0,))]
    found = []
    for start in starts:
        try:
            found.append(fit_degree(figure, targets, degree, start, options))
        except ConvergenceError:
            continue
    return min(found, key=lambda fit: fit.misfit, default=None)


def _summed(
    figure: Figure, targets: tuple[Target, ...], result: GaussNewtonResult, walk: _Walk, degree: int, solves: int
) -> Fit:
    theta, forces = walk.split(result.theta)
    n = 0 if walk.fixed is not None else len(theta)
    data = result.residual[: -(forces.size + n)]
    looks = sum(t.outline.length for t in targets) / (CORRELATION * figure.outline.size)
    normal = result.jacobian.T @ result.jacobian + 1e-12 * np.eye(result.jacobian.shape[1])
    misfit = float(data @ data)
    scale = max(1.0, misfit / max(looks - forces.size - n, 1.0))
    covariance = np.asarray(scale * np.linalg.inv(normal)[:n, :n], dtype=np.float64)
    return Fit(
        theta, forces.copy(), walk.best, misfit, looks, covariance, degree, solves, result.converged
    )  # fmt: skip


def _bounds(walk: _Walk, n: int) -> FloatArray:
    bounds = np.tile([-_FORCE_BOUND, _FORCE_BOUND], (n, 1))
    if walk.fixed is None:
        bounds[: len(walk.figure.parts) - 1] = RATIO_BOUNDS
    return bounds
