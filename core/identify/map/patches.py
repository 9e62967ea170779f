"""Partition of the organ into small patches of about equal volume, the unknowns of a stiffness map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Patches:
    """Partition of the organ.

    cells : (c,) the organ's cells. patch : (c,) patch of each cell, 0 to n - 1. centres : (n, 3) mm. volumes : (n,)
    mm3.
    """

    cells: IntArray
    patch: IntArray
    centres: FloatArray
    volumes: FloatArray

    @property
    def n(self) -> int:
        """Number of patches."""
        return len(self.centres)

    def of_cells(self, values: FloatArray) -> FloatArray:
        """Patch values (n,) on the organ's cells (c,)."""
        return np.asarray(values[self.patch], dtype=np.float64)

    def means(self, of_cells: FloatArray, cell_volumes: FloatArray) -> FloatArray:
        """Volume-weighted patch means (n,) of values on the organ's cells (c,)."""
        total = np.bincount(self.patch, of_cells * cell_volumes, self.n)
        return np.asarray(total / self.volumes, dtype=np.float64)


def cut(mesh: TetMesh, regions: tuple[int, ...], count: int, seed: int = 1) -> Patches:
    """About `count` patches of the union of regions, by k-means of the cell centres. Patches may cross the borders of
    regions.
    """
    cells = np.flatnonzero(np.isin(mesh.regions, regions))
    centres, volumes = mesh.points[mesh.cells[cells]].mean(axis=1), mesh.volumes[cells]
    _, patch = kmeans2(centres, min(count, len(cells)), iter=30, minit="++", rng=seed)
    _, patch = np.unique(patch, return_inverse=True)  # k-means may leave a cluster empty
    n = int(patch.max()) + 1
    total = np.bincount(patch, volumes, n)
    middle = np.stack([np.bincount(patch, volumes * x, n) / total for x in centres.T], axis=1)
    return Patches(cells, patch.astype(np.int64), middle, np.asarray(total, dtype=np.float64))
