"""Correspondence of two drawn outlines: the cheapest monotone pairing round both loops (dynamic time warping).

Sakoe and Chiba 1978, Dynamic programming algorithm optimization for spoken word recognition. It is a starting value
only: a line shows no points, so that the fit lets the figure slide along it.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.optimize import linear_sum_assignment

from palpate.applications.sketch.outline import Outline, perimeter, resampled_loop
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError

# Number of points of a loop in the matching, and of partners tried for the first of them.
_COUNT, _STARTS = 160, 40
# Weights of place (in figure sizes), direction and turn; price of a step that stretches or squeezes.
_PLACE, _DIRECTION, _TURN, _STRETCH = 2.0, 0.5, 0.4, 0.02
# The turn is taken over this share of the loop to either side.
_REACH = 0.025


def matched(rest: Outline, key: Outline, name: str = "the keyframe", held: bool = True) -> FloatArray:
    """(n, 2) mm: where on `key` each point of `rest` (n points) belongs.

    held : whether part of the figure is fixed; if not, positions are taken relative to the figure's centre.
    Raises InputError when the two have different numbers of holes.
    """
    if len(rest.loops) != len(key.loops):
        holes = len(rest.loops) - 1, len(key.loops) - 1
        raise InputError(f"{name} has {holes[1]} holes and the first keyframe {holes[0]}; draw the same figure in both")
    partner = _partners(rest, key)
    shift = np.zeros(2) if held else key.loops[0].mean(axis=0) - rest.loops[0].mean(axis=0)
    pairs = zip(rest.loops, partner, strict=True)
    return np.vstack([_on_loop(loop, key.loops[k] - shift, rest.size) + shift for loop, k in pairs])


def _partners(rest: Outline, key: Outline) -> list[int]:
    """The loop of `key` for each of `rest`: the outer ones, and holes by where they are in their figure."""
    if len(rest.loops) == 1:
        return [0]
    centres = [np.array([loop.mean(axis=0) - o.loops[0].mean(axis=0) for loop in o.loops[1:]]) for o in (rest, key)]
    cost = np.linalg.norm(centres[0][:, None] - centres[1][None], axis=2)
    return [0, *(1 + linear_sum_assignment(cost)[1]).tolist()]


def _on_loop(loop: FloatArray, target: FloatArray, size: float) -> FloatArray:
    a, b = (resampled_loop(x, _COUNT) for x in (loop, target))
    features = [_features(x, size) for x in (a, b)]
    cost = ((features[0][:, None] - features[1][None]) ** 2).sum(axis=2)
    first = np.argsort(cost[0])[:_STARTS]
    paths = [_path(np.roll(cost, -int(k), axis=1), _STRETCH) for k in first]
    best = int(np.argmin([price for price, _ in paths]))
    partner = paths[best][1] + first[best]  # of the points of `a`, may run on beyond the loop's end
    way = _way(loop) * _COUNT
    places = np.interp(way, np.arange(_COUNT + 1), np.append(partner, partner[0] + _COUNT)) % _COUNT
    closed = np.vstack([b, b[:1]])
    return np.column_stack([np.interp(places, np.arange(_COUNT + 1), closed[:, k]) for k in range(2)])


def _way(loop: FloatArray) -> FloatArray:
    """Arc length (n,) of each point along its loop, 0 to 1."""
    steps = np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1)
    return np.asarray((np.cumsum(steps) - steps) / perimeter(loop))


def _features(loop: FloatArray, size: float) -> FloatArray:
    """(n, 5) place, direction and turn, weighed."""
    k = max(1, round(_REACH * len(loop)))
    after, before = np.roll(loop, -k, axis=0) - loop, loop - np.roll(loop, k, axis=0)
    along = after + before
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    turn = np.arctan2(after[:, 1] * before[:, 0] - after[:, 0] * before[:, 1], (after * before).sum(axis=1))
    return np.hstack([np.sqrt(_PLACE) * loop / size, np.sqrt(_DIRECTION) * along, np.sqrt(_TURN) * turn[:, None]])


@njit(cache=True)
def _path(cost: FloatArray, stretch: float) -> tuple[float, FloatArray]:
    """Price of the cheapest monotone path from (0, 0) to (n - 1, m - 1), and the mean partner (n,) of each row along
    it.
    """
    n, m = cost.shape
    total = np.full((n, m), np.inf)
    came = np.zeros((n, m), dtype=np.int64)
    total[0, 0] = cost[0, 0]
    for i in range(n):
        for j in range(m):
            if i == 0 and j == 0:
                continue
            best, how = np.inf, 0
            if i > 0 and j > 0:
                best = total[i - 1, j - 1]
            if i > 0 and total[i - 1, j] + stretch < best:
                best, how = total[i - 1, j] + stretch, 1
            if j > 0 and total[i, j - 1] + stretch < best:
                best, how = total[i, j - 1] + stretch, 2
            total[i, j], came[i, j] = best + cost[i, j], how
    summed, count = np.zeros(n), np.zeros(n)
    i, j = n - 1, m - 1
    while True:
        summed[i] += j
        count[i] += 1.0
        if i == 0 and j == 0:
            break
        how = came[i, j]
        if how != 2:
            i -= 1
        if how != 1:
            j -= 1
    return total[n - 1, m - 1], summed / count
