"""Smooth triangle surfaces of labels: the organ with its regions, and the walls around it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.meshing.extend_labels import crop, extend_labels, without_specks
from palpate.meshing.smooth_distance import SIGMA_MM, SmoothField, smooth_field

# Room around a label, so that cropping does not touch its smoothing.
MARGIN_MM = 14.0


@dataclass(frozen=True, eq=False)
class TriSurface:
    """A triangulated surface with outward normals.

    points : (n, 3) mm LPS.  faces : (f, 3) point indices.  region : (f,) label each face belongs to.
    """

    points: FloatArray
    faces: IntArray
    region: IntArray

    @cached_property
    def face_normals(self) -> FloatArray:
        """Unit outward normals (f, 3)."""
        cross = self._cross
        return cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-30)

    @cached_property
    def areas(self) -> FloatArray:
        """Face areas (f,) mm2."""
        return 0.5 * np.linalg.norm(self._cross, axis=1)

    @cached_property
    def point_normals(self) -> FloatArray:
        """Unit outward normals (n, 3), the area-weighted mean of the faces around each point."""
        total = np.zeros_like(self.points)
        for corner in range(3):
            np.add.at(total, self.faces[:, corner], self._cross)
        return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)

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
        a, b, c = (self.points[self.faces[:, i]] for i in range(3))
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)

    def part(self, region: int) -> TriSurface:
        """The faces of one region, with the points they use."""
        faces = self.faces[self.region == region]
        used, inverse = np.unique(faces, return_inverse=True)
        return TriSurface(self.points[used], inverse.reshape(-1, 3), np.full(len(faces), region))

    @cached_property
    def _cross(self) -> FloatArray:
        a, b, c = (self.points[self.faces[:, i]] for i in range(3))
        return np.cross(b - a, c - a)


def organ_surfaces(
    labels: Volume, ids: tuple[int, ...] = (1, 2), step_mm: float = 1.0, sigma_mm: float = SIGMA_MM
) -> TriSurface:
    """The outer surface of the union of organ labels, each face marked by the label it belongs to.

    ``TriSurface.rim`` gives the points where regions meet. Use the same ``step_mm`` and ``sigma_mm`` for both states,
    so that what little the smoothing moves cancels.

    Raises InputError when none of the labels is there.
    """
    present = [i for i in ids if (labels.array == i).any()]
    if not present:
        raise InputError(f"label volume has no organ voxel (labels {ids}); draw the organ or check the label values")
    union = without_specks(np.isin(labels.array, present), share=0.2)
    near = crop(labels.with_array(np.where(union, labels.array, 0)), union, MARGIN_MM)
    points, faces = smooth_field(near, near.array > 0, step_mm, sigma_mm).contour()
    return TriSurface(points, faces, _region_of(points[faces].mean(axis=1), region_fields(near, present, sigma_mm)))


def wall_surface(labels: Volume, label: int, step_mm: float = 1.2, sigma_mm: float = SIGMA_MM) -> TriSurface:
    """The surface of one label (4 bone, 5 bladder, 6 rectum), open where it leaves the modelled box.

    The label is first carried on beyond the box, so there is no cap at its end. A label that is absent gives a
    surface without faces.
    """
    mask = without_specks(extend_labels(labels).array == label)
    if not mask.any():
        return TriSurface(np.empty((0, 3)), np.empty((0, 3), dtype=np.int64), np.empty(0, dtype=np.int64))
    near = crop(labels.with_array(mask), mask, MARGIN_MM)
    points, faces = smooth_field(near, near.array, step_mm, sigma_mm).contour()
    return TriSurface(points, faces, np.full(len(faces), label, dtype=np.int64))


def region_fields(organ: Volume, present: list[int], sigma_mm: float = SIGMA_MM) -> dict[int, SmoothField]:
    """One smooth field per organ label, each blind to what is outside the organ, so they meet on the dividing plane."""
    filled = extend_labels(organ)
    return {i: smooth_field(filled, filled.array == i, 1.0, sigma_mm) for i in present}


def _region_of(points: FloatArray, fields: dict[int, SmoothField]) -> IntArray:
    values = np.stack([field.at(points) for field in fields.values()])
    return np.array(list(fields))[np.argmax(values, axis=0)]
