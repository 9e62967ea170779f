"""Optimal surfaces over columns of samples, by one maximum flow (Li, Wu, Chen and Sonka, PAMI 2006).

A surface crosses each column once; the crossing of least total cost whose neighbours keep together is found exactly.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from palpate.core.arrays import FloatArray, IntArray

# Flows are whole numbers: costs are rounded to this share of one.
_UNITS = 100.0
_ENDLESS = 2**28


def region_cost(inside: FloatArray) -> FloatArray:
    """Cost (n, m) of cutting each column after each sample, from how well each sample belongs inside.

    inside : (n, m), positive where a sample looks like the organ, negative where it looks like what is around. The
    cost of a cut is the sum of what is left out and should be in, and of what is in and should be out; least where the
    sign turns.
    """
    return -np.cumsum(inside, axis=1)


def fall(likeness: FloatArray) -> FloatArray:
    """How much a likeness in -1 to 1 falls, 0 to 1, across each sample (n, m): an edge, whatever shape is expected."""
    before = np.pad(likeness, ((0, 0), (2, 0)), mode="edge")[:, :-2]
    after = np.pad(likeness, ((0, 0), (0, 3)), mode="edge")[:, 3:]
    return np.clip(before - after, 0.0, 2.0) / 2.0


def optimal_surface(cost: FloatArray, edges: IntArray, max_step: int, stiffness: float) -> IntArray:
    """Index (n,) at which the surface of least cost crosses each of n columns of m samples.

    cost : (n, m). edges : (e, 2) neighbouring columns. max_step : neighbours differ by no more samples than this.
    stiffness : cost of one sample of difference between neighbours.
    """
    n, m = cost.shape
    max_step = min(max_step, m - 1)
    node = np.arange(n * m).reshape(n, m)
    source, sink = n * m, n * m + 1
    weight = np.rint(np.diff(cost, axis=1, prepend=0.0) * _UNITS).astype(np.int64)
    weight[:, 0] = -_ENDLESS  # the first sample is always inside
    weight = np.clip(weight, -_ENDLESS, _ENDLESS)
    gain = weight < 0
    both = np.concatenate([edges, edges[:, ::-1]])
    a, b = node[both[:, 0]], node[both[:, 1]]
    links = [
        (np.full(gain.sum(), source), node[gain], -weight[gain]),
        (node[~gain], np.full((~gain).sum(), sink), weight[~gain]),
        _link(node[:, 1:], node[:, :-1], _ENDLESS),
        _link(a[:, max_step:], b[:, : m - max_step], _ENDLESS),
        _link(a, b, round(stiffness * _UNITS)),
    ]
    rows, columns, capacity = (np.concatenate(part) for part in zip(*links, strict=True))
    shape = (n * m + 2, n * m + 2)
    graph = csr_array(coo_array((capacity.astype(np.int32), (rows, columns)), shape=shape))
    flow = maximum_flow(graph, source, sink).flow
    left = csr_array(graph - flow)
    left.data = np.maximum(left.data, 0)
    left.eliminate_zeros()
    inside = np.zeros(n * m + 2, dtype=bool)
    inside[breadth_first_order(left, source, return_predecessors=False)] = True
    return inside[: n * m].reshape(n, m).sum(axis=1) - 1


def _link(start: IntArray, end: IntArray, capacity: int) -> tuple[IntArray, IntArray, IntArray]:
    return start.ravel(), end.ravel(), np.full(start.size, capacity, dtype=np.int64)


def crossing(profile: FloatArray, near: IntArray, level: float, reach: int) -> FloatArray:
    """Where (n,), in samples, profiles (n, m) fall through ``level`` nearest to ``near``; NaN where none within ``reach``.

    The place is interpolated between samples: this is what makes a boundary finer than the samples.
    """
    n, m = profile.shape
    falls = (profile[:, :-1] >= level) & (profile[:, 1:] < level)
    step = profile[:, :-1] - profile[:, 1:]
    at = np.arange(m - 1) + np.where(falls, (profile[:, :-1] - level) / np.where(falls, step, 1.0), 0.0)
    off = np.where(falls, np.abs(at - near[:, None]), np.inf)
    best = off.argmin(axis=1)
    found = at[np.arange(n), best]
    return np.where(off[np.arange(n), best] <= reach, found, np.nan)
