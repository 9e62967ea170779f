"""A triangulated surface whose faces carry the label they belong to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.surfaces import triangles


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles with outward normals.

    points : (n, 3) mm LPS. faces : (f, 3) point indices. region : (f,) label each face belongs to. sd_mm : (n,) standard
    deviation of the surface's error along its normal, mm; None where nothing is said of it. voxel_errors : (m, n) draws of
    the error that the label's voxels make along the normal, mm; None where the surface comes from no label.
    """

    points: FloatArray
    faces: IntArray
    region: IntArray
    sd_mm: FloatArray | None = None
    voxel_errors: FloatArray | None = None

    @classmethod
    def empty(cls) -> Surface:
        """The surface of a structure that is absent: no point, no face."""
        return cls(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), np.empty(0, dtype=np.int64))

    @cached_property
    def face_normals(self) -> FloatArray:
        """Unit outward normals (f, 3)."""
        return triangles.normals(self.points[self.faces])

    @cached_property
    def areas(self) -> FloatArray:
        """Face areas (f,) mm2."""
        return triangles.areas(self.points[self.faces])

    @cached_property
    def point_normals(self) -> FloatArray:
        """Unit outward normals (n, 3), the area-weighted mean of the faces around each point."""
        return triangles.point_normals(self.points, self.faces)

    @cached_property
    def rim(self) -> IntArray:
        """Points (r,) that faces of more than one region share."""
        lowest = np.full(len(self.points), np.iinfo(np.int64).max)
        highest = np.full(len(self.points), np.iinfo(np.int64).min)
        for corner in range(3):
            np.minimum.at(lowest, self.faces[:, corner], self.region)
            np.maximum.at(highest, self.faces[:, corner], self.region)
        return np.flatnonzero(lowest < highest)

    @property
    def enclosed_volume(self) -> float:
        """Volume in mm3; means something for a closed surface only."""
        return triangles.enclosed_volume(self.points, self.faces)

    def part(self, region: int) -> Surface:
        """The faces of one region, with the points they use."""
        faces = self.faces[self.region == region]
        used, inverse = np.unique(faces, return_inverse=True)
        sd = None if self.sd_mm is None else self.sd_mm[used]
        return Surface(self.points[used], inverse.reshape(-1, 3), np.full(len(faces), region), sd)

    def with_points(self, points: FloatArray) -> Surface:
        """The same faces on moved points (n, 3) mm."""
        return Surface(points, self.faces, self.region, self.sd_mm)
