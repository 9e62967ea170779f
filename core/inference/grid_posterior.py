"""Posterior of ln G on a grid: not normal where the data tell little, and cut at the bounds.

A normal distribution about the optimum takes the response to be linear in ln G. The response of an organ much stiffer
than its tissue fades with its stiffness, so that the likelihood falls more slowly above the optimum than below it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.inference.posterior import Posterior
from palpate.core.inference.response_surface import ResponseSurface

# Cells of the grid along an axis, by the number of parameters: fine enough that a quantile errs by a hundredth of the box.
CELLS = {1: 800, 2: 160, 3: 48}
# Density at an open face of the box, over the largest one, from which on the box is too small.
_FACE = 1e-3


@dataclass(frozen=True, eq=False)
class GridPosterior(Posterior):
    """Posterior with marginals of its own. mean (t,) : the optimum; covariance (t, t) : mean square about it.

    edges (t, g + 1) : of the cells. cumulative (t, g + 1) : probability below them.
    """

    edges: FloatArray
    cumulative: FloatArray

    @property
    def spread(self) -> FloatArray:
        """See `Posterior.spread`."""
        weight, centre = np.diff(self.cumulative, axis=1), 0.5 * (self.edges[:, 1:] + self.edges[:, :-1])
        mean = (weight * centre).sum(axis=1, keepdims=True)
        return np.sqrt((weight * (centre - mean) ** 2).sum(axis=1))

    def quantile(self, probability: FloatArray | float) -> FloatArray:
        """See `Posterior.quantile`."""
        p = np.broadcast_to(probability, np.broadcast_shapes(np.shape(probability), (len(self.mean),)))
        columns = [np.interp(p[..., k], self.cumulative[k], self.edges[k]) for k in range(len(self.mean))]
        return np.stack(columns, axis=-1)

    def of(self, rows: slice) -> Posterior:
        """See `Posterior.of`."""
        part = super().of(rows)
        return GridPosterior(**vars(part), edges=self.edges[rows], cumulative=self.cumulative[rows])


def on_grid(normal: Posterior, surface: ResponseSurface) -> GridPosterior | None:
    """Posterior whose misfit is that of a response surface of the weighted residual, with a flat prior over its box.

    normal : Laplace's approximation. None where the box is too small to hold it.
    """
    box, t = surface.box, len(surface.box)
    cells = CELLS[t]
    edges = np.linspace(box[:, 0], box[:, 1], cells + 1, axis=1)
    centres = 0.5 * (edges[:, 1:] + edges[:, :-1])
    points = np.stack(np.meshgrid(*centres, indexing="ij"), axis=-1).reshape(-1, t)
    misfit = np.concatenate([(surface.at(part) ** 2).sum(axis=1) for part in np.array_split(points, 16)])
    weight = np.exp(-0.5 * (misfit - misfit.min()) / normal.scale**2).reshape((cells,) * t)
    if _cut_off(weight, box, normal.bounds):
        return None
    weight /= weight.sum()
    marginals = np.stack([weight.sum(axis=tuple(a for a in range(t) if a != k)) for k in range(t)])
    cumulative = np.hstack([np.zeros((t, 1)), np.cumsum(marginals, axis=1)])
    off = points - normal.mean
    covariance = (off * weight.reshape(-1, 1)).T @ off
    return GridPosterior(**vars(replace(normal, covariance=covariance)), edges=edges, cumulative=cumulative)


def _cut_off(weight: FloatArray, box: FloatArray, bounds: FloatArray) -> bool:
    """Whether a face of the box that is no bound has much of the density (largest: 1)."""
    for axis in range(weight.ndim):
        for side, end in enumerate((0, -1)):
            is_bound = np.isclose(box[axis, side], bounds[axis, side])
            if not is_bound and np.take(weight, end, axis=axis).max() > _FACE:
                return True
    return False
