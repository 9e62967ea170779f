"""The triangles and the wished edge lengths that the mesher is given."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
import pyvista as pv
from scipy.optimize import brentq
from scipy.spatial import cKDTree

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.surfaces.triangles import areas
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, OUTSIDE, RECTUM, SURROUNDING_TISSUE
from palpate.meshing.partition import ORGAN, Partition
from palpate.meshing.smooth_distance import SmoothField
from palpate.meshing.tetwild import Soup

# Wished edge of each surface as a multiple of the organ's.
EDGE_FACTOR = {ORGAN: 1.0, BLADDER: 1.15, RECTUM: 1.15, BONE: 1.7, OUTSIDE: 2.8}
# How far a surface runs on beyond the surface that ends it, so that the two are sewn together.
LIP_MM = 0.5
# The result may leave the triangles by this share of the organ's edge; it is fitted to the smooth surfaces afterwards.
ENVELOPE = 0.12
# Cells made per unit of volume / edge^3 and per triangle given, from 12 meshes of 4 anatomies (4,000 to 45,000 cells).
CELLS_PER_CUBE, CELLS_PER_TRIANGLE = 8.5, 1.25
ORDERS = tuple(permutations(range(3)))


@dataclass(frozen=True, eq=False)
class Scene:
    """All that is known before the size of the mesh is chosen.

    surfaces : (points (n, 3), faces (f, 3), field whose zero it is, factor of its edge) of each interface.
    grid_points (s, 3), grid_cells (t, 4): background cells; grid_distance (s,) mm from the organ, infinite outside.
    kept : background cells (t,) in organ or tissue. cube_mm3 : volume of a background cell.
    """

    surfaces: list[tuple[FloatArray, IntArray, SmoothField, float]]
    grid_points: FloatArray
    grid_cells: IntArray
    grid_distance: FloatArray
    kept: BoolArray
    cell_mm3: float

    def size_mm(self, edge_mm: float, far_factor: float, grading: float) -> FloatArray:
        """Wished edge (s,) at the background points."""
        grown = edge_mm + grading * np.maximum(self.grid_distance - 3.0, 0.0)
        return np.clip(grown, edge_mm, far_factor * edge_mm)

    def expected_cells(self, edge_mm: float, far_factor: float, grading: float) -> float:
        """About how many cells of organ and tissue a mesh will have."""
        size = self.size_mm(edge_mm, far_factor, grading)[self.grid_cells[self.kept]].mean(axis=1)
        cubes = self.cell_mm3 * float((size**-3.0).sum())
        triangles = sum(_area(p, f) / _triangle(factor * edge_mm) for p, f, _, factor in self.surfaces)
        return CELLS_PER_CUBE * cubes + CELLS_PER_TRIANGLE * triangles

    def edge_for(self, target: float, far_factor: float, grading: float) -> float:
        """The organ edge, 0.5 to 50 mm, with which about ``target`` cells come out."""
        ends = [self.expected_cells(edge, far_factor, grading) for edge in (0.5, 50.0)]
        wanted = float(np.clip(target, ends[1], ends[0]))
        return float(brentq(lambda e: self.expected_cells(e, far_factor, grading) - wanted, 0.5, 50.0, rtol=1e-3))

    def soup(self, edge_mm: float, far_factor: float, grading: float) -> Soup:
        """Coarse triangles of all interfaces and the sizing field."""
        parts = [_decimated(p, f, field, factor * edge_mm) for p, f, field, factor in self.surfaces]
        starts = np.cumsum([0] + [len(points) for points, _ in parts])
        return Soup(
            points=np.concatenate([points for points, _ in parts]),
            faces=np.concatenate([faces + start for (_, faces), start in zip(parts, starts, strict=False)]),
            size_points=self.grid_points,
            size_cells=self.grid_cells,
            size_mm=self.size_mm(edge_mm, far_factor, grading),
            edge_mm=far_factor * edge_mm,
            epsilon_mm=ENVELOPE * edge_mm,
        )


def make_scene(partition: Partition) -> Scene:
    """The interfaces of a partition and the background on which edge lengths are wished."""
    surfaces = [_body(partition, key) for key in partition.bodies]
    surfaces.append((*partition.outside.contour(), partition.outside, EDGE_FACTOR[OUTSIDE]))
    if all(i in partition.regions for i in ORGAN_LABELS):
        surfaces.append(_divide(partition))
    surfaces = [surface for surface in surfaces if len(surface[1])]
    points, cells, cell_mm3 = _background(np.concatenate([p[np.unique(f)] for p, f, _, _ in surfaces]))
    distance, _ = cKDTree(surfaces[0][0]).query(points)
    distance[partition.bodies[ORGAN].at(points) > 0.0] = 0.0
    distance[partition.outside.at(points) > 2.0] = np.inf
    kept = np.isin(partition.classify(points[cells].mean(axis=1)), (*ORGAN_LABELS, SURROUNDING_TISSUE))
    return Scene(surfaces, points, cells, distance, kept, cell_mm3)


def _body(partition: Partition, key: int) -> tuple[FloatArray, IntArray, SmoothField, float]:
    """The surface of one body, without what lies outside the modelled region."""
    field = partition.against_others(key)
    points, faces = field.contour()
    return points, faces[(partition.outside.at(points) < 3.0)[faces].any(axis=1)], field, EDGE_FACTOR[key]


def _divide(partition: Partition) -> tuple[FloatArray, IntArray, SmoothField, float]:
    """The surface between the two organ regions, ending just outside the organ."""
    field = partition.divide(*ORGAN_LABELS)
    points, faces = field.contour()
    inside = partition.bodies[ORGAN].at(points) > -LIP_MM
    return points, faces[inside[faces].all(axis=1)], field, EDGE_FACTOR[ORGAN]


def _area(points: FloatArray, faces: IntArray) -> float:
    return float(areas(points[faces]).sum())


def _triangle(edge_mm: float) -> float:
    return float(np.sqrt(3.0) / 4.0 * edge_mm**2)


def _decimated(points: FloatArray, faces: IntArray, field: SmoothField, edge_mm: float) -> tuple[FloatArray, IntArray]:
    """A surface with triangles of about ``edge_mm``, its vertices on the zero of the field."""
    used, inverse = np.unique(faces, return_inverse=True)
    surface = pv.PolyData(points[used], np.insert(inverse.reshape(-1, 3), 0, 3, axis=1).ravel())
    share = surface.area / _triangle(edge_mm) / len(faces)
    if share < 1.0:
        surface = surface.decimate(1.0 - share, volume_preservation=True)
    found = np.asarray(surface.points, dtype=np.float64)
    # Quadric decimation throws single vertices far off nearly flat places.
    for _ in range(3):
        slope = field.gradient(found)
        found = found - slope * (field.at(found) / np.maximum((slope**2).sum(axis=1), 0.25))[:, None]
    return found, np.asarray(surface.regular_faces, dtype=np.int64)


def _background(points: FloatArray, step_mm: float = 6.0) -> tuple[FloatArray, IntArray, float]:
    """Points, cells and cell volume of a regular mesh of the box around the points."""
    low, high = points.min(axis=0) - 1.0, points.max(axis=0) + 1.0
    count = np.ceil((high - low) / step_mm).astype(int) + 1
    number = np.arange(count.prod()).reshape(count)
    corner = number[:-1, :-1, :-1].ravel()[:, None, None]
    # Kuhn's six cells of a cube: one for each order in which the three axes are gone along.
    walks = [np.cumsum([0, *(int(number[tuple(step)]) for step in np.eye(3, dtype=int)[list(way)])]) for way in ORDERS]
    axes = [np.linspace(low[i], high[i], count[i]) for i in range(3)]
    place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    cells = (corner + np.array(walks)).reshape(-1, 4)
    return place.reshape(-1, 3), cells, float(np.prod((high - low) / (count - 1)) / len(ORDERS))
