"""Distances from a deformed organ surface to the surface it should have reached: Eqs 10 to 13 of Yang & Lin, MaterialCloning.

All are one-sided, from the deformed surface's points to the target as a continuous surface, not to its points only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
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


def region_distances(points: FloatArray, region: IntArray, targets: Mapping[int, TriangleTree]) -> FloatArray:
    """Distance (n,) mm of each point (n, 3) from the target of its own region (n,): what Eq 13 squares and sums.

    Points that several regions share are the caller's to leave out. Raises InputError when a region has no target or there is
    no point.
    """
    if len(points) == 0:
        raise InputError("no surface point belongs to one region alone; check the regions of the organ's surface")
    out = np.empty(len(points))
    for name in np.unique(region):
        if int(name) not in targets:
            raise InputError(f"region {name} has points on the organ's surface but no target surface")
        mine = region == name
        out[mine] = point_distances(points[mine], targets[int(name)])
    return out


def surface_misfit(points: FloatArray, region: IntArray, targets: Mapping[int, TriangleTree]) -> SurfaceMisfit:
    """The figures a report shows: Eq 10 over all regions as hausdorff_mm, Eq 13 as objective_mm2. Arguments: see `region_distances`."""
    d = region_distances(points, region, targets)
    squares = float(np.sum(d**2))
    return SurfaceMisfit(
        float(np.sqrt(squares / len(d))), float(np.percentile(d, 95.0)), float(d.max()), squares, len(d)
    )
