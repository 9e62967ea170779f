"""What windows of two images say of the motion between them, without a displacement of any one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from palpate.core.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class WindowScores:
    """Weighted means of gradient times difference of two images, three a window, over their standard deviations.

    middles : (w, 3) mm, of the windows. nodes : (p, 3) mm, places at rest whose displacements v (p, 3) mm the scores depend
    on. response : (3 w, 3 p) 1/mm. value : (3 w,), what response @ v is for the motion that the images show. pairs : (k, 2)
    windows whose errors go along, each with itself too; blocks : (k, 3, 3) covariance of the two.
    """

    middles: FloatArray
    nodes: FloatArray
    response: sp.csr_matrix
    value: FloatArray
    pairs: IntArray
    blocks: FloatArray

    @cached_property
    def covariance(self) -> FloatArray:
        """Covariance (3 w, 3 w) of the errors of all scores."""
        n = len(self.middles)
        out = np.zeros((n, 3, n, 3))
        first, second = self.pairs.T
        out[first, :, second, :] = self.blocks
        out[second, :, first, :] = np.swapaxes(self.blocks, 1, 2)
        return out.reshape(3 * n, 3 * n)

    def of(self, windows: BoolArray) -> WindowScores:
        """Those of some windows (w,)."""
        number = np.cumsum(windows) - 1
        both = windows[self.pairs].all(axis=1)
        rows = np.repeat(windows, 3)
        return replace(
            self,
            middles=self.middles[windows],
            response=self.response[rows],
            value=self.value[rows],
            pairs=number[self.pairs[both]],
            blocks=self.blocks[both],
        )

    def share_at(self, nodes: BoolArray) -> FloatArray:
        """Share (w,) of each window's response that is to some of the nodes (p,)."""
        size = abs(self.response)
        there, every = (
            np.asarray(size[:, np.repeat(which, 3)].sum(axis=1)).reshape(-1, 3).sum(axis=1)
            for which in (nodes, np.ones(len(nodes), dtype=bool))
        )
        return np.asarray(there / np.maximum(every, 1e-12))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """For numpy.savez; `from_arrays` is the inverse.

        Columns rise within a row. In any other order scipy would sort them in place at their first use, and the same scores would
        have another hash before and after a fit.
        """
        response = self.response.sorted_indices()
        return {
            "middles": self.middles,
            "nodes": self.nodes,
            "response": response.data.astype(np.float32),
            "columns": response.indices.astype(np.int32),
            "starts": response.indptr.astype(np.int64),
            "value": self.value,
            "pairs": self.pairs,
            "blocks": self.blocks,
        }

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> WindowScores:
        """Raises KeyError when an array is missing."""
        middles, nodes, values, value, blocks = (
            np.asarray(data[key], dtype=np.float64) for key in ("middles", "nodes", "response", "value", "blocks")
        )
        columns, starts, pairs = (np.asarray(data[key], dtype=np.int64) for key in ("columns", "starts", "pairs"))
        response = sp.csr_matrix((values, columns, starts), shape=(3 * len(middles), 3 * len(nodes)))
        return cls(middles, nodes, response, value, pairs, blocks)
