"""Partition of the organ into small patches of about equal volume, the unknowns of a stiffness map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.cluster.vq import kmeans2

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Patches:
    """Partition of the organ; no patch crosses the border of two regions.

    cells : (c,) the organ's cells. patch : (c,) patch of each cell, 0 to n - 1. centres : (n, 3) mm. volumes : (n,)
    mm3. region : (n,) of the mesh.
    """

    cells: IntArray
    patch: IntArray
    centres: FloatArray
    volumes: FloatArray
    region: IntArray

    @property
    def n(self) -> int:
        """Number of patches."""
        return len(self.centres)

    @property
    def regions(self) -> tuple[int, ...]:
        """Regions, ascending."""
        return tuple(int(r) for r in np.unique(self.region))

    @property
    def members(self) -> FloatArray:
        """(n, regions) 1 where a patch lies in a region, 0 elsewhere."""
        return np.asarray(self.region[:, None] == np.array(self.regions), dtype=np.float64)

    @property
    def averages(self) -> FloatArray:
        """(regions, n) weights of the patches in a region's volume average."""
        total = self.members * self.volumes[:, None]
        return np.asarray((total / total.sum(axis=0)).T, dtype=np.float64)

    def of_cells(self, values: FloatArray) -> FloatArray:
        """Patch values (n,) on the organ's cells (c,)."""
        return np.asarray(values[self.patch], dtype=np.float64)


def cut(mesh: TetMesh, regions: tuple[int, ...], count: int, seed: int = 1) -> Patches:
    """About `count` patches of the union of regions, each region's share by its volume, by k-means of the cell centres."""
    organ = np.flatnonzero(np.isin(mesh.regions, regions))
    whole, cells, patch, n = float(mesh.volumes[organ].sum()), [], [], 0
    for region in regions:
        mine = np.flatnonzero(mesh.regions == region)
        share = max(1, round(count * float(mesh.volumes[mine].sum()) / whole))
        _, found = kmeans2(_centres(mesh, mine), min(share, len(mine)), iter=30, minit="++", rng=seed)
        _, found = np.unique(found, return_inverse=True)  # k-means may leave a cluster empty
        cells.append(mine)
        patch.append(found.astype(np.int64) + n)
        n += int(found.max()) + 1
    all_cells, of_cell = np.concatenate(cells), np.concatenate(patch)
    volumes = mesh.volumes[all_cells]
    total = np.bincount(of_cell, volumes, n)
    middle = [np.bincount(of_cell, volumes * x, n) / total for x in _centres(mesh, all_cells).T]
    region_of = mesh.regions[all_cells[np.unique(of_cell, return_index=True)[1]]]
    return Patches(all_cells, of_cell, np.stack(middle, axis=1), np.asarray(total, dtype=np.float64), region_of)


def _centres(mesh: TetMesh, cells: IntArray) -> FloatArray:
    return np.asarray(mesh.points[mesh.cells[cells]].mean(axis=1), dtype=np.float64)
