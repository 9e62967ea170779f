"""The organ cut into small patches of about equal volume, each with one stiffness: what a stiffness map is solved on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Patches:
    """cells (c,) : the organ's cells. patch (c,) : 0 to n - 1 of each. centres (n, 3) mm, volumes (n,) mm3."""

    cells: IntArray
    patch: IntArray
    centres: FloatArray
    volumes: FloatArray

    @property
    def n(self) -> int:
        """How many."""
        return len(self.centres)

    def of_cells(self, values: FloatArray) -> FloatArray:
        """Values (n,) of patches on the organ's cells (c,)."""
        return np.asarray(values[self.patch], dtype=np.float64)

    def means(self, of_cells: FloatArray, cell_volumes: FloatArray) -> FloatArray:
        """Means (n,) by volume of values on the organ's cells (c,)."""
        total = np.bincount(self.patch, of_cells * cell_volumes, self.n)
        return np.asarray(total / self.volumes, dtype=np.float64)


def cut(mesh: TetMesh, regions: tuple[int, ...], count: int, seed: int = 1) -> Patches:
    """About `count` patches (k-means of the cells' centres) of the union of regions; they do not heed the regions' borders."""
    cells = np.flatnonzero(np.isin(mesh.regions, regions))
    centres, volumes = mesh.points[mesh.cells[cells]].mean(axis=1), mesh.volumes[cells]
    _, patch = kmeans2(centres, min(count, len(cells)), iter=30, minit="++", rng=seed)
    _, patch = np.unique(patch, return_inverse=True)  # k-means may leave one empty
    n = int(patch.max()) + 1
    total = np.bincount(patch, volumes, n)
    middle = np.stack([np.bincount(patch, volumes * x, n) / total for x in centres.T], axis=1)
    return Patches(cells, patch.astype(np.int64), middle, np.asarray(total, dtype=np.float64))
