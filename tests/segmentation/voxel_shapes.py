"""Analytic shapes, their voxels, and the distance of points from them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from palpate.imaging.volume import Volume

FloatArray = NDArray[np.float64]
Shape = Callable[[FloatArray], FloatArray]  # points (..., 3) mm -> negative inside
TILT = Rotation.from_euler("xyz", [13.0, -21.0, 8.0], degrees=True).as_matrix()


def prostate(points: FloatArray) -> FloatArray:
    """Tilted ellipsoid with semi-axes 24, 18, 20 mm and two lobes that differ: no plane of symmetry."""
    y = points @ TILT
    radius = np.linalg.norm(y, axis=-1) + 1e-12
    d = y / radius[..., None]
    ellipsoid = 1.0 / np.sqrt((d[..., 0] / 24.0) ** 2 + (d[..., 1] / 18.0) ** 2 + (d[..., 2] / 20.0) ** 2 + 1e-30)
    return radius - ellipsoid * (1.0 + 0.05 * d[..., 0] * d[..., 2] + 0.06 * d[..., 1] ** 3)


def tube(radius_mm: float, x: float = 0.0, y: float = 0.0, bend: float = 0.004) -> Shape:
    """A tilted, bent tube through (x, y, 0)."""

    def level(points: FloatArray) -> FloatArray:
        p = (points - np.array([x, y, 0.0])) @ TILT
        return np.hypot(p[..., 0] - bend * p[..., 2] ** 2, p[..., 1]) - radius_mm

    return level


def ball(radius_mm: float, centre: tuple[float, float, float]) -> Shape:
    """A ball."""
    return lambda points: np.linalg.norm(points - np.array(centre), axis=-1) - radius_mm


def grid(spacing: tuple[float, float, float], half_mm: tuple[float, float, float], shift: FloatArray) -> Volume:
    """An empty label volume around the origin, its centres moved by ``shift`` mm."""
    count = np.ceil(2.0 * np.array(half_mm) / spacing).astype(int) + 1
    affine = np.diag([*spacing, 1.0])
    affine[:3, 3] = shift - (count - 1) / 2.0 * spacing
    return Volume(np.zeros(count, dtype=np.uint8), affine)


def paint(labels: Volume, shape: Shape, value: int) -> Volume:
    """The labels with every voxel whose centre is inside the shape set to a value."""
    centres = labels.to_lps(np.moveaxis(np.indices(labels.array.shape), 0, -1).reshape(-1, 3).astype(float))
    inside = (shape(centres) < 0.0).reshape(labels.array.shape)
    return labels.with_array(np.where(inside, value, labels.array).astype(np.uint8))


def distance(shape: Shape, points: FloatArray) -> FloatArray:
    """Signed distance (n,) mm of points near a shape, positive outside: by Newton steps along the gradient."""
    foot = points.copy()
    for _ in range(6):
        slope = _slope(shape, foot)
        foot -= slope * (shape(foot) / (slope**2).sum(axis=1))[:, None]
    slope = _slope(shape, foot)
    return np.einsum("ij,ij->i", points - foot, slope / np.linalg.norm(slope, axis=1, keepdims=True))


def _slope(shape: Shape, points: FloatArray, step: float = 1e-4) -> FloatArray:
    moves = step * np.eye(3)
    return np.stack([(shape(points + m) - shape(points - m)) / (2.0 * step) for m in moves], axis=-1)
