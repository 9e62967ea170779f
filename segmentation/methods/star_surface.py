"""Star-shaped surfaces: a centre, directions, and one radius along each."""

from __future__ import annotations

from functools import cache

import numpy as np
import pyvista as pv

from palpate.core.arrays import FloatArray
from palpate.core.surfaces.triangles import area_vectors
from palpate.segmentation.methods.surface_mesh import Shell


@cache
def sphere() -> Shell:
    """The unit sphere by 642 directions, about evenly spread."""
    ball = pv.Icosphere(radius=1.0, nsub=3)
    points = np.asarray(ball.points, dtype=np.float64)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    faces = np.asarray(ball.regular_faces, dtype=np.int64)
    outward = (area_vectors(points[faces]) * points[faces[:, 0]]).sum(axis=1) > 0.0
    return Shell(points, np.where(outward[:, None], faces, faces[:, ::-1]))


def ellipsoid_radii(semi_axes: FloatArray, power: float = 2.0) -> FloatArray:
    """Radii (642,) mm of an ellipsoid with semi-axes (3,) mm along LPS; ``power`` above 2 makes it boxier."""
    return np.asarray((np.abs(sphere().points / semi_axes) ** power).sum(axis=1) ** (-1.0 / power))


def star(centre: FloatArray, radii: FloatArray) -> Shell:
    """The surface with radii (642,) mm about a centre (3,) mm."""
    return sphere().moved(centre + radii[:, None] * sphere().points)
