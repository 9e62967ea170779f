"""The triangles and the wished edge lengths that the mesher is given."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pyvista as pv
from scipy.spatial import cKDTree

from palpate.segmentation.labels import BLADDER, BONE, ORGAN_LABELS, OUTSIDE, RECTUM
from palpate.segmentation.partition import ORGAN, Partition
from palpate.segmentation.smooth_field import FloatArray, IntArray, SmoothField
from palpate.segmentation.tetwild import Soup

# Wished edge of each surface as a multiple of the organ's.
EDGE_FACTOR = {ORGAN: 1.0, BLADDER: 1.15, RECTUM: 1.15, BONE: 1.7, OUTSIDE: 2.8}
# How far a surface runs on beyond the surface that ends it, so that the two are sewn together.
LIP_MM = 0.5
ORDERS = tuple(permutations(range(3)))


def make_soup(partition: Partition, edge_mm: float, far_factor: float, grading: float) -> Soup:
    """Coarse triangles of all interfaces and a sizing field.

    edge_mm : wished edge on the organ.  far_factor : how much longer edges may be far away.
    grading : growth of the edge per mm of distance from the organ.
    """
    parts = [_body(partition, key, edge_mm * EDGE_FACTOR[key]) for key in partition.bodies]
    parts.append(_decimated(partition.outside.contour(), partition.outside, edge_mm * EDGE_FACTOR[OUTSIDE]))
    parts.append(_divide(partition, edge_mm))
    starts = np.cumsum([0] + [len(points) for points, _ in parts])
    points = np.concatenate([points for points, _ in parts])
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)])
    size_points, size_cells = _background(points)
    distance = _distance_to_organ(partition, parts[0][0], size_points)
    size = np.clip(edge_mm + grading * np.maximum(distance - 3.0, 0.0), edge_mm, far_factor * edge_mm)
    size[partition.outside.at(size_points) > 2.0] = far_factor * edge_mm
    return Soup(points, faces, size_points, size_cells, size, far_factor * edge_mm, 0.12 * edge_mm)


def _body(partition: Partition, key: int, edge_mm: float) -> tuple[FloatArray, IntArray]:
    """The surface of one body, without what lies outside the modelled region."""
    field = partition.against_others(key)
    points, faces = field.contour()
    return _decimated((points, faces[(partition.outside.at(points) < 3.0)[faces].any(axis=1)]), field, edge_mm)


def _divide(partition: Partition, edge_mm: float) -> tuple[FloatArray, IntArray]:
    """The surface between the two organ regions, ending just outside the organ; no faces when there is one region."""
    if not all(i in partition.regions for i in ORGAN_LABELS):
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    field = partition.divide(*ORGAN_LABELS)
    points, faces = field.contour()
    inside = partition.bodies[ORGAN].at(points) > -LIP_MM
    return _decimated((points, faces[inside[faces].all(axis=1)]), field, edge_mm)


def _decimated(
    triangles: tuple[FloatArray, IntArray], field: SmoothField, edge_mm: float
) -> tuple[FloatArray, IntArray]:
    """A surface with triangles of about ``edge_mm``, its vertices on the zero of the field."""
    points, faces = triangles
    if len(faces) == 0:
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    used, inverse = np.unique(faces, return_inverse=True)
    surface = pv.PolyData(points[used], np.insert(inverse.reshape(-1, 3), 0, 3, axis=1).ravel())
    share = surface.area / (np.sqrt(3.0) / 4.0 * edge_mm**2) / len(faces)
    if share < 1.0:
        surface = surface.decimate(1.0 - share, volume_preservation=True)
    found = np.asarray(surface.points, dtype=np.float64)
    # Quadric decimation throws single vertices far off nearly flat places.
    for _ in range(3):
        slope = field.gradient(found)
        found = found - slope * (field.at(found) / np.maximum((slope**2).sum(axis=1), 0.25))[:, None]
    return found, np.asarray(surface.regular_faces, dtype=np.int64)


def _background(points: FloatArray, step_mm: float = 6.0) -> tuple[FloatArray, IntArray]:
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    count = np.ceil((high - low) / step_mm).astype(int) + 1
    number = np.arange(count.prod()).reshape(count)
    corner = number[:-1, :-1, :-1].ravel()[:, None, None]
    # Kuhn's six cells of a cube: one for each order in which the three axes are gone along.
    walks = [np.cumsum([0, *(int(number[tuple(step)]) for step in np.eye(3, dtype=int)[list(way)])]) for way in ORDERS]
    axes = [np.linspace(low[i], high[i], count[i]) for i in range(3)]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    return place.reshape(-1, 3), (corner + np.array(walks)).reshape(-1, 4)


def _distance_to_organ(partition: Partition, organ_points: FloatArray, points: FloatArray) -> FloatArray:
    """Distance (n,) mm from the organ, zero inside it."""
    distance, _ = cKDTree(organ_points).query(points)
    return np.where(partition.bodies[ORGAN].at(points) > 0.0, 0.0, distance)
