"""Interpolation from one grid to another whose axes are the same: one sparse matrix for each axis."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import FloatArray


def along_axis(weights: sp.csr_array, values: FloatArray, axis: int) -> FloatArray:
    """Values (ni, nj, nk) multiplied by weights (m, n) along an axis of n."""
    first = np.moveaxis(values, axis, 0)
    out = weights @ np.ascontiguousarray(first).reshape(len(first), -1)
    return np.moveaxis(out.reshape(-1, *first.shape[1:]), 0, axis)


def cubic_weights(places: FloatArray, n: int) -> sp.csr_array:
    """Weights (m, n) of cubic B-splines about n grid points at places (m,) in units of their distance.

    Precondition: two grid points lie on either side of every place, or it is a grid point with one on either side.
    """
    t = places - np.floor(places)
    s = 1.0 - t
    inner = [(4.0 - 3.0 * a * a * (2.0 - a)) / 6.0 for a in (t, s)]
    return _banded(np.floor(places) - 1, np.stack([s**3 / 6.0, *inner, t**3 / 6.0], axis=1), n)


def linear_weights(places: FloatArray, n: int) -> sp.csr_array:
    """Weights (m, n) of linear interpolation between n > 1 grid points at places (m,); the nearest end's value beyond them."""
    inside = np.clip(places, 0.0, n - 1.0)
    first = np.minimum(np.floor(inside), n - 2.0)
    return _banded(first, np.stack([1.0 - (inside - first), inside - first], axis=1), n)


def _banded(first: FloatArray, weights: FloatArray, n: int) -> sp.csr_array:
    """Matrix (m, n) whose row q has weights (m, k) from column first[q] on; what would lie beyond column n has none."""
    m, k = weights.shape
    columns = first.astype(np.int64)[:, None] + np.arange(k)
    within = (columns >= 0) & (columns < n)
    rows = np.repeat(np.arange(m), k).reshape(m, k)
    return sp.csr_array((weights[within], (rows[within], columns[within])), shape=(m, n))
