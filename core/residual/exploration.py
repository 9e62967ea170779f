"""A model around its fit: the weighted residual as a response surface, and the posterior that follows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.inference.grid_posterior import CELLS, on_grid
from palpate.core.inference.posterior import Posterior, laplace
from palpate.core.inference.response_surface import ResponseSurface, chebyshev_nodes
from palpate.core.observe.contour_noise import Weighting
from palpate.core.residual.joint_states import JointLinearisation, JointModel
from palpate.core.worker.progress import Progress, silent

# Points along an axis at which the model is solved, by the number of parameters; a normal approximation serves for more.
# Against 144 points on two cases whose intervals span a factor of 3 to 20, quantiles of ln G differ by 0.01.
_NODES = {1: 7, 2: 4, 3: 4}
# Half the width of the box that is looked at first, in standard deviations of the normal approximation.
_WITHIN_SD = 5.0
# Share of the points that must have an equilibrium.
_SOLVED = 0.8


@dataclass(frozen=True, eq=False)
class Whitened:
    """A solved model. residual (n,) and gradient (n, t) : weighted, of what is to be explored."""

    at: JointLinearisation
    residual: FloatArray
    gradient: FloatArray


# The model at theta (t,), started from the equilibria of another one; None where it has none.
Solve = Callable[[FloatArray, JointLinearisation], Whitened | None]


def posterior_of(
    model: JointModel, weighting: Weighting, fit: JointLinearisation, bounds: FloatArray, progress: Progress = silent
) -> Posterior:
    """Posterior of theta (t,) of the plain model over its bounds (t, 2); see `explored`. fit : its optimum."""

    def seen(at: JointLinearisation) -> Whitened:
        return Whitened(at, weighting.whiten(at.residual), weighting.whiten(at.in_theta))

    def solve(theta: FloatArray, near: JointLinearisation) -> Whitened | None:
        there = model.plain(theta, near)
        return None if there is None else seen(there)

    return explored(solve, seen(fit), bounds, progress, "plain model")


def explored(
    solve: Solve, optimum: Whitened, bounds: FloatArray, progress: Progress = silent, words: str = "model"
) -> Posterior:
    """Posterior of theta (t,) over its bounds (t, 2), on a grid.

    With more than three parameters, or where the model has no equilibrium at many of the points, it is Laplace's. words : what is
    solved, for the progress.
    """
    normal = laplace(optimum.at.theta, optimum.residual, optimum.gradient, bounds)
    if len(bounds) not in CELLS:
        return normal
    reach = _WITHIN_SD * normal.sd[:, None] * np.array([-1.0, 1.0])
    near = np.clip(optimum.at.theta[:, None] + reach, bounds[:, :1], bounds[:, 1:])
    for box in (near, bounds):
        surface = _surface(solve, optimum, box, progress, words)
        found = None if surface is None else on_grid(normal, surface)
        if found is not None:
            return found
    return normal


def _surface(
    solve: Solve, optimum: Whitened, box: FloatArray, progress: Progress, words: str
) -> ResponseSurface | None:
    """Weighted residual over a box; None where too few points have an equilibrium."""
    nodes = chebyshev_nodes(box, _NODES[len(box)])
    solved, here = [optimum], optimum
    for k, theta in enumerate(nodes):
        progress(k / len(nodes), f"{words}: how well the scans tell the stiffness, {k + 1} of {len(nodes)}")
        there = solve(theta, here.at)
        if there is not None:
            solved.append(there)
            here = there
    if len(solved) - 1 < _SOLVED * len(nodes):
        return None
    values = np.stack([s.residual for s in solved])
    gradients = np.stack([s.gradient for s in solved])
    return ResponseSurface.of(box, np.stack([s.at.theta for s in solved]), values, gradients)
