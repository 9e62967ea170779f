"""Tetrahedral meshes with region ids: checks and measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError

# The face opposite to vertex i, ordered so that its normal points out of a positive cell.
FACES_OF_CELL = np.array([[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]])


@dataclass(frozen=True, eq=False)
class TetMesh:
    """A conforming mesh of linear tetrahedra.

    points : (n, 3) mm, DICOM patient coordinates (LPS).
    cells : (m, 4) point indices, positive volume.
    regions : (m,) region id of each cell, the label values of the case format (1, 2 organ; 3 tissue).

    Raises InputError when shapes disagree, an index is out of range, a coordinate is not finite or a
    cell has no positive volume.
    """

    points: FloatArray
    cells: IntArray
    regions: IntArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", np.ascontiguousarray(self.points, dtype=np.float64))
        object.__setattr__(self, "cells", np.ascontiguousarray(self.cells, dtype=np.int64))
        object.__setattr__(self, "regions", np.ascontiguousarray(self.regions, dtype=np.int64))
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise InputError(f"mesh points have shape {self.points.shape}; (n, 3) is needed")
        if self.cells.ndim != 2 or self.cells.shape[1] != 4 or len(self.cells) == 0:
            raise InputError(f"mesh cells have shape {self.cells.shape}; (m, 4) with m > 0 is needed")
        if self.regions.shape != (len(self.cells),):
            raise InputError(f"mesh has {len(self.cells)} cells but {self.regions.shape} region ids")
        if self.cells.min() < 0 or self.cells.max() >= len(self.points):
            raise InputError("a mesh cell names a point that does not exist")
        if not np.isfinite(self.points).all():
            raise InputError("a mesh point is not finite")
        worst = int(np.argmin(self.volumes))
        if self.volumes[worst] <= 0.0:
            raise InputError(f"mesh cell {worst} has volume {self.volumes[worst]:.3g} mm3; positive volumes are needed")

    @cached_property
    def volumes(self) -> FloatArray:
        """Signed volume of each cell, (m,) mm3."""
        return cell_volumes(self.points, self.cells)

    @cached_property
    def boundary(self) -> tuple[IntArray, IntArray]:
        """Faces that belong to one cell only: (faces (f, 3) outward point indices, owner cell (f,))."""
        return self._one_sided(np.arange(len(self.cells)))

    def region_boundary(self, region_ids: tuple[int, ...]) -> tuple[IntArray, IntArray]:
        """Outward faces of the union of regions: (faces (f, 3), owner cell (f,)). Interior faces between the regions are not part."""
        key = tuple(region_ids)
        if key not in self._region_boundaries:
            self._region_boundaries[key] = self._one_sided(np.flatnonzero(np.isin(self.regions, region_ids)))
        return self._region_boundaries[key]

    @cached_property
    def _region_boundaries(self) -> dict[tuple[int, ...], tuple[IntArray, IntArray]]:
        """Those that were asked for; nobody may change them in place."""
        return {}

    def submesh(self, region_ids: tuple[int, ...]) -> tuple[TetMesh, IntArray]:
        """The part of the mesh in the given regions, and for each of its points the index in this mesh."""
        keep = np.isin(self.regions, region_ids)
        if not keep.any():
            raise InputError(f"mesh has no cell in regions {region_ids}; it has {sorted(set(self.regions.tolist()))}")
        nodes, cells = np.unique(self.cells[keep], return_inverse=True)
        return TetMesh(self.points[nodes], cells.reshape(-1, 4), self.regions[keep]), nodes

    def _one_sided(self, cell_ids: IntArray) -> tuple[IntArray, IntArray]:
        faces = self.cells[cell_ids][:, FACES_OF_CELL].reshape(-1, 3)
        _, inverse, counts = np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True)
        single = counts[inverse.ravel()] == 1
        return faces[single], np.repeat(cell_ids, 4)[single]


def cell_volumes(points: FloatArray, cells: IntArray) -> FloatArray:
    """Signed volumes (m,) mm3 of tetrahedra with corners `cells` (m, 4) among points (n, 3) mm."""
    a, b, c, d = (points[cells[:, i]] for i in range(4))
    return np.asarray(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6.0, dtype=np.float64)
