"""The random walker with prior (Grady, PAMI 2006 and CVPR 2005): how likely it is that a walk from a voxel ends inside.

Walks cross edges of the picture rarely; where the picture says nothing, they share the space between the seeds evenly.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import LinearOperator, cg

from palpate.core.arrays import FloatArray
from palpate.segmentation.working_grid import Mask

# No edge stops a walk wholly: what noise has cut off still hangs together.
LEAST_WEIGHT = 1e-3
TOLERANCE, MOST_ROUNDS = 2e-3, 300


def walk(
    values: NDArray[np.floating], inside: Mask, outside: Mask, edge: float, prior: FloatArray, pull: float
) -> FloatArray:
    """Probability, 0 to 1, of belonging inside, for every voxel of an even grid.

    values : the picture (i, j, k). inside, outside : seeds, which stay what they are; outside wins. edge : difference of
    neighbours that is an edge rather than noise, in units of the picture. prior : probability by what is known beforehand.
    pull : how strongly a voxel follows its prior, against the weight 1 of a neighbour that looks the same.
    """
    weights = [LEAST_WEIGHT + np.exp(-0.5 * (np.diff(values, axis=a) / edge) ** 2) for a in range(3)]
    free = ~(inside | outside)
    fixed = np.where(inside & ~outside, 1.0, 0.0)
    start = np.where(free, prior, fixed)
    diagonal = np.full(values.shape, pull)
    for axis, weight in enumerate(weights):
        before, after = _halves(axis)
        diagonal[before] += weight
        diagonal[after] += weight

    def applied(flat: FloatArray) -> FloatArray:
        x = np.where(free, flat.reshape(values.shape), 0.0)
        return np.asarray(np.where(free, diagonal * x - _spread(weights, x), 0.0).ravel())

    def preconditioned(flat: FloatArray) -> FloatArray:
        return np.asarray(flat / diagonal.ravel())

    right = np.where(free, pull * prior + _spread(weights, np.where(free, 0.0, fixed)), 0.0).ravel()
    size = (values.size, values.size)
    # A walk that has not come to its end after so many rounds is as good as one that has: the last rounds move hundredths.
    found, _ = cg(
        LinearOperator(size, matvec=applied, dtype=float),
        right,
        x0=np.where(free, start, 0.0).ravel(),
        rtol=TOLERANCE,
        maxiter=MOST_ROUNDS,
        M=LinearOperator(size, matvec=preconditioned, dtype=float),
    )
    return np.asarray(np.where(free, np.clip(found.reshape(values.shape), 0.0, 1.0), fixed))


def _spread(weights: list[FloatArray], x: FloatArray) -> FloatArray:
    """The weighted sum over each voxel's neighbours."""
    total = np.zeros_like(x)
    for axis, weight in enumerate(weights):
        before, after = _halves(axis)
        total[before] += weight * x[after]
        total[after] += weight * x[before]
    return total


def _halves(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """All but the last, and all but the first, along an axis."""
    everything = [slice(None)] * 3
    before, after = everything.copy(), everything.copy()
    before[axis], after[axis] = slice(None, -1), slice(1, None)
    return tuple(before), tuple(after)
