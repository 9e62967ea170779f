"""The plain model around its fit: the weighted residual as a response surface, and the posterior that follows."""

from __future__ import annotations

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


def posterior_of(
    model: JointModel, weighting: Weighting, fit: JointLinearisation, bounds: FloatArray, progress: Progress = silent
) -> Posterior:
    """Posterior of theta (t,) over its bounds (t, 2), on a grid.

    fit : the model's optimum. With more than three parameters, or where the model has no equilibrium at many of the
    points, it is Laplace's.
    """
    normal = laplace(fit.theta, weighting.whiten(fit.residual), weighting.whiten(fit.in_theta), bounds)
    if len(bounds) not in CELLS:
        return normal
    reach = _WITHIN_SD * normal.sd[:, None] * np.array([-1.0, 1.0])
    near = np.clip(fit.theta[:, None] + reach, bounds[:, :1], bounds[:, 1:])
    for box in (near, bounds):
        surface = _surface(model, weighting, fit, box, progress)
        found = None if surface is None else on_grid(normal, surface)
        if found is not None:
            return found
    return normal


def _surface(
    model: JointModel, weighting: Weighting, fit: JointLinearisation, box: FloatArray, progress: Progress
) -> ResponseSurface | None:
    """Weighted residual over a box; None where too few points have an equilibrium."""
    nodes = chebyshev_nodes(box, _NODES[len(box)])
    solved, here = [fit], fit
    for k, theta in enumerate(nodes):
        progress(k / len(nodes), f"plain model: how well the scans tell the stiffness, {k + 1} of {len(nodes)}")
        there = model.plain(theta, here)
        if there is not None:
            solved.append(there)
            here = there
    if len(solved) - 1 < _SOLVED * len(nodes):
        return None
    values = np.stack([weighting.whiten(s.residual) for s in solved])
    gradients = np.stack([weighting.whiten(s.in_theta) for s in solved])
    return ResponseSurface.of(box, np.stack([s.theta for s in solved]), values, gradients)
