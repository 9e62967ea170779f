"""Rigid surfaces for contact: a plane and a dish."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import ConvexHull

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.core.surfaces.triangles import area_vectors


@dataclass(frozen=True, eq=False)
class RigidSurface:
    """points (n, 3) mm; faces (f, 3), whose normals point to where bodies are."""

    points: FloatArray
    faces: IntArray

    @cached_property
    def tree(self) -> TriangleTree:
        """For distances."""
        return TriangleTree.of(self.points, self.faces)


def depth(surface: RigidSurface, x: FloatArray) -> float:
    """Largest depth of points x (q, 3) behind the surface, mm; negative: minus the least distance in front of it.

    A point whose nearest part is the surface's rim is beside it, neither behind nor in front.
    """
    closest = closest_points(surface.tree, x)
    beside = surface.tree.rim[closest.triangle, closest.part]
    return float(np.max(np.where(beside, -closest.distance, -closest.signed)))


def plane(point: ArrayLike, normal: ArrayLike, reach: float = 1000.0) -> RigidSurface:
    """One triangle around `point` (3,) mm that reaches at least so far, mm; normal (3,) points to where bodies are."""
    n = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    a = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    a /= np.linalg.norm(a)
    b = np.cross(n, a)
    angles = np.radians([90.0, 210.0, 330.0])
    corners = np.asarray(point, dtype=float) + 2.0 * reach * (np.cos(angles)[:, None] * a + np.sin(angles)[:, None] * b)
    return RigidSurface(corners, np.array([[0, 1, 2]]))


def dish(lowest: ArrayLike, radius: float, rim: float, rings: int = 14) -> RigidSurface:
    """The inside of a spherical cap, hollow upwards (+z): `lowest` (3,) mm is its lowest point, rim mm its radius at
    the rim.

    radius : mm, of the sphere, larger than the rim. Ring k has 6 k corners, all on the sphere; the faces are those of
    their convex hull, so that the inside is convex as the sphere's is.
    """
    centre = np.asarray(lowest, dtype=float) + [0.0, 0.0, radius]
    tilt = np.concatenate([np.full(max(1, 6 * k), k / rings) for k in range(rings + 1)]) * np.arcsin(rim / radius)
    turn = np.concatenate([2.0 * np.pi * np.arange(max(1, 6 * k)) / max(1, 6 * k) for k in range(rings + 1)])
    points = np.stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), -np.cos(tilt)], axis=1)
    faces = ConvexHull(points).simplices.astype(np.int64)
    faces = faces[(faces < len(points) - 6 * rings).any(axis=1)]  # without the lid, whose corners are all on the rim
    X = points[faces]
    outward = (area_vectors(X) * X.mean(axis=1)).sum(axis=1) > 0.0
    faces[outward] = faces[outward][:, [0, 2, 1]]
    return RigidSurface(centre + radius * points, faces)
