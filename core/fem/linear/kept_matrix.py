"""The matrix of the kept unknowns, assembled from dense blocks."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.linear.pattern import Pattern, scatter


class KeptMatrix:
    """values : of its upper triangle, in the pattern's order. product : (size,), its product with a move of constrained
    unknowns.

    size : of all unknowns. along : (3 n,) that move; None for none.
    """

    def __init__(self, pattern: Pattern, size: int, along: FloatArray | None) -> None:
        self._pattern = pattern
        self.values, self.product = np.zeros(len(pattern.indices)), np.zeros(size)
        self._move: FloatArray | None = None
        if along is not None and along.any():
            self._move = np.concatenate([along, np.zeros(size - len(along))])

    def add(self, family: int, blocks: FloatArray, rows: IntArray, unknowns: IntArray) -> None:
        """Adds blocks (k, d, d), upper triangles, of these rows of a family whose unknowns (all rows, d) these are."""
        scatter(blocks, self._pattern.slots[family][rows], self.values)
        if self._move is None:
            return
        local = self._move[unknowns[rows]]
        moved = local.any(axis=1)
        upper = blocks[moved]
        full = np.triu(upper) + np.swapaxes(np.triu(upper, 1), 1, 2)
        np.add.at(self.product, unknowns[rows][moved], np.einsum("eij,ej->ei", full, local[moved]))
