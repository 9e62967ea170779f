"""Sparsity of a symmetric matrix made of small dense blocks, found once per mesh; later only values change."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit

from palpate.core.arrays import FloatArray, Int32Array, IntArray


@dataclass(frozen=True, eq=False)
class Pattern:
    """Upper triangle in CSR of the rows and columns that are kept, and where every block entry goes.

    n : number of kept unknowns. indptr (n + 1,), indices (nnz,) int32, columns ascending, diagonal always present.
    slots : per block family, (blocks, k (k + 1) / 2) position in the values of each upper entry, -1 where dropped.
    """

    n: int
    indptr: Int32Array
    indices: Int32Array
    slots: tuple[Int32Array, ...]

    @classmethod
    def of(cls, families: list[IntArray], number_of: IntArray) -> Pattern:
        """families: arrays (blocks, k) of unknowns; number_of (N,): new number of each unknown, -1 for dropped ones."""
        n = int(number_of.max()) + 1
        renumbered = [number_of[f] for f in families]
        counts = np.ones(n + 1, dtype=np.int64)
        counts[0] = 0
        for f in renumbered:
            _count(f, counts)
        start = np.cumsum(counts)
        columns = np.empty(start[-1], dtype=np.int32)
        fill = start[:-1].copy()
        _fill_diagonal(columns, fill)
        for f in renumbered:
            _fill(f, columns, fill)
        indptr = np.zeros(n + 1, dtype=np.int64)
        _compress(columns, start, indptr)
        indptr = np.cumsum(indptr)
        indices = np.empty(indptr[-1], dtype=np.int32)
        _copy(columns, start, indptr, indices)
        slots = tuple(_find_slots(f, indptr, indices) for f in renumbered)
        return cls(n, indptr.astype(np.int32), indices, slots)

    def matrix(self, values: FloatArray) -> sp.csr_matrix:
        """The upper triangle as a SciPy matrix (shares `values`)."""
        return sp.csr_matrix((values, self.indices, self.indptr), shape=(self.n, self.n))


@njit(cache=True)
def _count(blocks: IntArray, counts: IntArray) -> None:
    for b in range(blocks.shape[0]):
        for i in range(blocks.shape[1]):
            r = blocks[b, i]
            if r < 0:
                continue
            for j in range(blocks.shape[1]):
                if blocks[b, j] > r:
                    counts[r + 1] += 1


@njit(cache=True)
def _fill_diagonal(columns: IntArray, fill: IntArray) -> None:
    for r in range(len(fill)):
        columns[fill[r]] = r
        fill[r] += 1


@njit(cache=True)
def _fill(blocks: IntArray, columns: IntArray, fill: IntArray) -> None:
    for b in range(blocks.shape[0]):
        for i in range(blocks.shape[1]):
            r = blocks[b, i]
            if r < 0:
                continue
            for j in range(blocks.shape[1]):
                c = blocks[b, j]
                if c > r:
                    columns[fill[r]] = c
                    fill[r] += 1


@njit(cache=True)
def _compress(columns: IntArray, start: IntArray, lengths: IntArray) -> None:
    """Sort each row and drop repeats in place; lengths[r + 1] is what is left of row r."""
    for r in range(len(start) - 1):
        row = columns[start[r] : start[r + 1]]
        row.sort()
        kept = 0
        for k in range(len(row)):
            if k == 0 or row[k] != row[kept - 1]:
                row[kept] = row[k]
                kept += 1
        lengths[r + 1] = kept


@njit(cache=True)
def _copy(columns: IntArray, start: IntArray, indptr: IntArray, indices: Int32Array) -> None:
    for r in range(len(start) - 1):
        n = indptr[r + 1] - indptr[r]
        indices[indptr[r] : indptr[r + 1]] = columns[start[r] : start[r] + n]


@njit(cache=True)
def _find_slots(blocks: IntArray, indptr: IntArray, indices: Int32Array) -> Int32Array:
    k = blocks.shape[1]
    slots = np.empty((blocks.shape[0], k * (k + 1) // 2), dtype=np.int32)
    for b in range(blocks.shape[0]):
        s = 0
        for i in range(k):
            for j in range(i, k):
                r, c = blocks[b, i], blocks[b, j]
                if r > c:
                    r, c = c, r
                slots[b, s] = -1
                if r >= 0:
                    low, high = indptr[r], indptr[r + 1] - 1
                    while low < high:
                        mid = (low + high) // 2
                        if indices[mid] < c:
                            low = mid + 1
                        else:
                            high = mid
                    slots[b, s] = low
                s += 1
    return slots


@njit(cache=True)
def scatter(blocks: FloatArray, slots: Int32Array, values: FloatArray) -> None:
    """values[slots] += upper triangle of symmetric blocks (b, k, k); dropped entries (slot -1) are skipped."""
    k = blocks.shape[1]
    for b in range(blocks.shape[0]):
        s = 0
        for i in range(k):
            for j in range(i, k):
                slot = slots[b, s]
                if slot >= 0:
                    values[slot] += blocks[b, i, j]
                s += 1
