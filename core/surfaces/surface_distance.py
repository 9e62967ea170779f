"""Distances from a deformed organ surface to the surface it should have reached: Eqs 10 to 13 of Yang & Lin, MaterialCloning.

All are one-sided, from the deformed surface's points to the target as a continuous surface, not to its points only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree


@dataclass(frozen=True)
class SurfaceMisfit:
    """How far a surface is from its target: root mean square, 95th percentile and greatest distance in mm, the objective
    of Eq 13 in mm2, and the number of points that count."""

    rms_mm: float
    p95_mm: float
    hausdorff_mm: float
    objective_mm2: float
    points: int


def point_distances(points: FloatArray, target: TriangleTree) -> FloatArray:
    """Distance (n,) mm of each point (n, 3) from the target surface: the inner minimum of Eq 10."""
    return closest_points(target, points).distance


def hausdorff(points: FloatArray, target: TriangleTree) -> float:
    """One-sided Hausdorff distance, mm, of points (n, 3) from the target (Eq 10)."""
    return float(point_distances(points, target).max())


def objective(points: FloatArray, target: TriangleTree) -> float:
    """Sum of squared distances, mm2, of points (n, 3) (Eqs 11 and 12)."""
    return float(np.sum(point_distances(points, target) ** 2))


def shared_points(faces: IntArray, face_region: IntArray, n_points: int) -> BoolArray:
    """Whether each of n points is used by faces (f, 3) of more than one region (f,): the ones Eq 13 leaves out."""
    lowest, highest = np.full(n_points, np.iinfo(np.int64).max), np.full(n_points, np.iinfo(np.int64).min)
    for corner in faces.T:
        np.minimum.at(lowest, corner, face_region)
        np.maximum.at(highest, corner, face_region)
    return lowest < highest


def region_distances(
    points: FloatArray,
    region: IntArray,
    targets: Mapping[int, TriangleTree],
    shared: BoolArray | None = None,
) -> FloatArray:
    """Distances (k,) mm of the points (n, 3) that count, each from the target of its own region (n,).

    Points marked in `shared` (n,) do not count. Raises InputError when a region has no target or no point counts.
    """
    counts = np.ones(len(points), dtype=bool) if shared is None else ~shared
    if not counts.any():
        raise InputError("no surface point belongs to one region alone; check the regions of the organ's surface")
    out = np.full(len(points), np.nan)
    for name in np.unique(region[counts]):
        if int(name) not in targets:
            raise InputError(f"region {name} has points on the organ's surface but no target surface")
        mine = counts & (region == name)
        out[mine] = point_distances(points[mine], targets[int(name)])
    return out[counts]


def multi_region_objective(
    points: FloatArray,
    region: IntArray,
    targets: Mapping[int, TriangleTree],
    shared: BoolArray | None = None,
) -> float:
    """Sum over regions and their points of squared distances, mm2 (Eq 13). Arguments: see `region_distances`."""
    return float(np.sum(region_distances(points, region, targets, shared) ** 2))


def surface_misfit(
    points: FloatArray,
    region: IntArray,
    targets: Mapping[int, TriangleTree],
    shared: BoolArray | None = None,
) -> SurfaceMisfit:
    """The figures a report shows. Arguments: see `region_distances`."""
    d = region_distances(points, region, targets, shared)
    squares = float(np.sum(d**2))
    return SurfaceMisfit(
        float(np.sqrt(squares / len(d))), float(np.percentile(d, 95.0)), float(d.max()), squares, len(d)
    )
