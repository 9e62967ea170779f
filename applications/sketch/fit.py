"""Stiffness and rim forces of a figure from drawn keyframes, by Gauss-Newton on the distance of the outlines.

The residual is the distance of Eqs 11 to 13 of Yang & Lin, signed and in both directions: the figure's rim from the
drawn line and the line from the rim. All keyframes share the stiffness; each has its own forces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.applications.sketch.figure import Figure
from palpate.applications.sketch.fit_walk import FitOptions, Walk
from palpate.applications.sketch.outline import hausdorff
from palpate.applications.sketch.residual import CORRELATION, Target
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.state import State
from palpate.core.inference.gauss_newton import GaussNewtonResult, gauss_newton
from palpate.core.worker.progress import Progress, silent

# Largest Hausdorff distance of a keyframe that counts as hit, in figure sizes.
HIT = 0.02
# Stages of the first approach to a keyframe, point to point with fixed stiffness; steps in each.
_STAGES = (0.34, 0.67, 1.0)
_FEW = 6
# Starting values of ln ratio, and the degree of the forces up to which all are tried.
_STARTS, _STARTED_ANEW = (0.0, -1.5, 1.5), 1


@dataclass(frozen=True, eq=False)
class Fit:
    """theta (P - 1,) = ln of stiffness ratios; forces : (k, r) coefficients of each keyframe; states, their equilibria.

    misfit : squared whitened residual of the outlines. looks : number of independent data. covariance (P - 1, P - 1) of
    theta. goals : (k, q, 3) mm, where springs of `spring` (see `Figure.loaded`) pull the rim's points beside those
    forces; None where the forces were enough, see `closing`.
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
        """Schwarz's criterion: misfit plus ln(number of data) for every force coefficient."""
        return self.misfit + self.forces.size * float(np.log(self.looks))


def fit_degree(
    figure: Figure,
    targets: tuple[Target, ...],
    degree: int,
    start: Fit | FloatArray | None = None,
    options: FitOptions | None = None,
    fixed: FloatArray | None = None,
) -> Fit:
    """Gauss-Newton at one degree of the force polynomials.

    start : a fit of a lower degree to go on from, or theta (P - 1,) to begin with. fixed : theta to keep, forces alone
    are looked for. Raises ConvergenceError when not even the start has an equilibrium.
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
        walk = Walk(figure, targets, basis, options, share, kept, last)
        x = np.concatenate([theta if kept is None else [], coefficients.ravel()])
        most = options.evaluations if share is None else _FEW
        result = gauss_newton(walk, x, walk.bounds(), max_evaluations=most)
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
    """The fit with the fewest force coefficients that the drawn lines ask for (Schwarz 1978, Estimating the dimension
    of a model).

    One that hits every keyframe within HIT everywhere is preferred to any that does not. Low degrees are begun from
    several ratios of stiffness, higher ones go on from the one before. Raises ConvergenceError when no degree has an
    equilibrium near the keyframes.
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
    fits = []
    for start in starts:
        try:
            fits.append(fit_degree(figure, targets, degree, start, options))
        except ConvergenceError:
            continue
    return min(fits, key=lambda fit: fit.misfit, default=None)


def _summed(
    figure: Figure, targets: tuple[Target, ...], result: GaussNewtonResult, walk: Walk, degree: int, solves: int
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
