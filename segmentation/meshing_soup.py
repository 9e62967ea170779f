"""The triangles and the wished edge lengths that the mesher is given."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from palpate.segmentation.partition import ORGAN, ORGAN_IDS, Partition
from palpate.segmentation.smooth_field import FloatArray, IntArray
from palpate.segmentation.tetwild import Soup
from scipy.spatial import cKDTree

# Wished edge of each surface as a multiple of the organ's.
EDGE_FACTOR = {ORGAN: 1.0, 5: 1.25, 6: 1.2, 4: 2.2, 0: 2.8}
# How far a surface runs on beyond the surface that ends it, so that the two are sewn together.
LIP_MM = 0.5


def make_soup(partition: Partition, edge_mm: float, far_factor: float, grading: float) -> Soup:
    """Coarse triangles of all interfaces and a sizing field.

    edge_mm : wished edge on the organ.  far_factor : how much longer edges may be far away.
    grading : growth of the edge per mm of distance from the organ.
    """
    parts = [_decimated(_ending_outside(partition, key), edge_mm * EDGE_FACTOR[key]) for key in partition.bodies]
    parts.append(_decimated(partition.outside.contour(), edge_mm * EDGE_FACTOR[0]))
    divide = _dividing_surface(partition)
    if len(divide[1]):
        parts.append(_decimated(divide, edge_mm))
    starts = np.cumsum([0] + [len(points) for points, _ in parts])
    points = np.concatenate([points for points, _ in parts])
    faces = np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)])
    size_points, size_cells = _background(points)
    distance = _distance_to_organ(partition, parts[0][0], size_points)
    size = np.clip(edge_mm + grading * np.maximum(distance - 3.0, 0.0), edge_mm, far_factor * edge_mm)
    size[partition.outside.at(size_points) > 2.0] = far_factor * edge_mm
    return Soup(points, faces, size_points, size_cells, size, far_factor * edge_mm, 0.12 * edge_mm)


def _ending_outside(partition: Partition, key: int) -> tuple[FloatArray, IntArray]:
    """The surface of one body, without what lies outside the modelled region."""
    points, faces = partition.against_others(key).contour()
    return points, faces[(partition.outside.at(points) < 3.0)[faces].any(axis=1)]


def _dividing_surface(partition: Partition) -> tuple[FloatArray, IntArray]:
    """The surface between the two organ regions, ending just outside the organ."""
    if not all(i in partition.regions for i in ORGAN_IDS):
        return np.empty((0, 3)), np.empty((0, 3), dtype=np.int64)
    points, faces = partition.divide(*ORGAN_IDS).contour()
    return points, faces[(partition.bodies[ORGAN].at(points) > -LIP_MM)[faces].all(axis=1)]


def _decimated(triangles: tuple[FloatArray, IntArray], edge_mm: float) -> tuple[FloatArray, IntArray]:
    """A surface with triangles of about ``edge_mm`` that encloses the same volume."""
    points, faces = triangles
    used, inverse = np.unique(faces, return_inverse=True)
    surface = pv.PolyData(points[used], np.insert(inverse.reshape(-1, 3), 0, 3, axis=1).ravel())
    share = surface.area / (np.sqrt(3.0) / 4.0 * edge_mm**2) / max(len(faces), 1)
    if share < 1.0:
        surface = surface.decimate(1.0 - share, volume_preservation=True)
    return np.asarray(surface.points, dtype=np.float64), np.asarray(surface.regular_faces, dtype=np.int64)


def _background(points: FloatArray, step_mm: float = 6.0) -> tuple[FloatArray, IntArray]:
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    count = np.ceil((high - low) / step_mm).astype(int) + 1
    image = pv.ImageData(dimensions=tuple(count), spacing=tuple((high - low) / (count - 1)), origin=tuple(low))
    grid: pv.UnstructuredGrid = image.to_tetrahedra(tetra_per_cell=5)
    cells = grid.cells.reshape(-1, 5)[:, 1:]
    return np.asarray(grid.points, dtype=np.float64), np.asarray(cells, dtype=np.int64)


def _distance_to_organ(partition: Partition, organ_points: FloatArray, points: FloatArray) -> FloatArray:
    """Distance (n,) mm from the organ, zero inside it."""
    distance, _ = cKDTree(organ_points).query(points)
    return np.where(partition.bodies[ORGAN].at(points) > 0.0, 0.0, distance)
