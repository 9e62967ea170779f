"""Rigid surfaces that a body may fall on: a plane and a dish."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from palpate.core.observe.closest_point import closest_points
from palpate.core.observe.triangle_tree import TriangleTree

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


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
    """How far the deepest of points x (q, 3) lies behind the surface, mm; negative: how near the nearest in front comes.

    A point whose nearest part is the surface's rim is beside it, neither behind nor in front.
    """
    found = closest_points(surface.tree, x)
    beside = surface.tree.rim[found.triangle, found.part]
    return float(np.max(np.where(beside, -found.distance, -found.signed)))


def plane(point: ArrayLike, normal: ArrayLike, reach: float = 1000.0) -> RigidSurface:
    """One triangle around `point` (3,) mm that reaches at least so far, mm; normal (3,) points to where bodies are."""
    n = np.asarray(normal, dtype=float) / np.linalg.norm(normal)
    a = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    a /= np.linalg.norm(a)
    b = np.cross(n, a)
    angles = np.radians([90.0, 210.0, 330.0])
    corners = np.asarray(point, dtype=float) + 2.0 * reach * (np.cos(angles)[:, None] * a + np.sin(angles)[:, None] * b)
    return RigidSurface(corners, np.array([[0, 1, 2]]))


def dish(lowest: ArrayLike, radius: float, rim: float, rings: int = 14, sectors: int = 48) -> RigidSurface:
    """The inside of a spherical cap, hollow upwards (+z): `lowest` (3,) mm is its lowest point, rim mm its radius at the rim.

    Its corners lie on the sphere, so the inside is convex as the sphere's is. radius : mm, of the sphere, larger than the rim.
    """
    centre = np.asarray(lowest, dtype=float) + [0.0, 0.0, radius]
    tilt = np.arcsin(rim / radius) * np.arange(1, rings + 1) / rings
    # Every other ring is turned by half a sector: triangles stay close to equilateral.
    turn = 2.0 * np.pi * (np.arange(sectors)[None, :] + 0.5 * (np.arange(rings) % 2)[:, None]) / sectors
    ring = np.stack([np.sin(tilt)[:, None] * np.cos(turn), np.sin(tilt)[:, None] * np.sin(turn),
                     np.broadcast_to(-np.cos(tilt)[:, None], turn.shape)], axis=-1)  # fmt: skip
    points = np.vstack([[[0.0, 0.0, -1.0]], ring.reshape(-1, 3)])
    return RigidSurface(centre + radius * points, _dish_faces(rings, sectors))


def _dish_faces(rings: int, sectors: int) -> IntArray:
    k = np.arange(sectors)
    following = (k + 1) % sectors
    faces = [np.stack([np.zeros(sectors, dtype=np.int64), 1 + k, 1 + following], axis=1)]
    for r in range(rings - 1):
        inner, outer = 1 + r * sectors, 1 + (r + 1) * sectors
        # The outer ring is half a sector ahead of an even inner ring, and behind an odd one.
        ahead, behind = (k, (k - 1) % sectors) if r % 2 == 0 else (following, k)
        faces.append(np.stack([inner + k, outer + behind, outer + ahead], axis=1))
        faces.append(np.stack([inner + k, outer + ahead, inner + following], axis=1))
    return np.vstack(faces)
