"""Rigid alignment of two surfaces in unrelated frames."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.identify.pair.rigid_pair import rigid_motion
from palpate.core.problem import SurfacePair
from palpate.core.statistics import rms
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.rigid_motion import transformed
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.triangle_tree import TriangleTree

# Residual distance, as a share of the extent, above which rotations are tried, and the factor by which one must lower it.
_NEAR, _LESS = 0.002, 0.75


def aligned(pair: SurfacePair) -> FloatArray:
    """(4, 4) rigid motion from the deformed surface onto the one at rest, mm.

    The nearest motion is used where it fits. Otherwise all alignments of the principal axes are tried. The ends of a
    symmetric body cannot be distinguished by shape.
    """
    back = SurfacePair(pair.deformed, pair.rest)
    first = rigid_motion(back)
    size = float(np.ptp(pair.rest.points, axis=0).max())
    if _left(back, first) < _NEAR * size:
        return first
    best = min((rigid_motion(back, turn) for turn in _turns(back)), key=lambda m: _left(back, m))
    return best if _left(back, best) < _LESS * _left(back, first) else first


def _turns(pair: SurfacePair) -> list[FloatArray]:
    """Rotations (3, 3) that bring the principal axes of one surface onto the other's."""
    a, b = (_axes(surface) for surface in (pair.rest, pair.deformed))
    signs = [np.diag([x, y, x * y]) for x in (1.0, -1.0) for y in (1.0, -1.0)]
    return [b @ sign @ a.T for sign in signs]


def _axes(surface: Surface) -> FloatArray:
    """(3, 3) principal axes in columns, a right-handed system."""
    area, middle = surface.areas, surface.points[surface.faces].mean(axis=1)
    centre = middle - np.average(middle, axis=0, weights=area)
    _, axes = np.linalg.eigh((centre * area[:, None]).T @ centre)
    return np.asarray(axes * np.array([1.0, 1.0, np.linalg.det(axes)]))


def _left(pair: SurfacePair, matrix: FloatArray) -> float:
    """Rms distance, mm, of the moved surface's points from the other."""
    target = TriangleTree.of(pair.deformed.points, pair.deformed.faces)
    step = max(1, len(pair.rest.points) // 2000)
    distance = closest_points(target, transformed(matrix, pair.rest.points[::step])).distance
    return rms(distance)
