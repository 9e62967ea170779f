"""Where a pixel of a 3D picture of the desktop windows points in the patient, and back; parallel projection, head up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Camera:
    """azimuth, elevation : degrees; 0, 0 looks from the front. centre : (3,) mm LPS in the middle. half : mm, seen each way at zoom 1."""

    azimuth: float
    elevation: float
    zoom: float
    centre: FloatArray
    half: float

    @property
    def axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Right, up, and towards the one who looks, (3,) each."""
        a, e = np.deg2rad(self.azimuth), np.deg2rad(self.elevation)
        towards = np.array([np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])
        right = np.array([np.cos(a), np.sin(a), 0.0])
        return right, np.cross(towards, right), towards

    def mm_per_pixel(self, width: int, height: int) -> float:
        """Of a picture of that size."""
        return 2.0 * self.half / self.zoom / min(width, height)

    def pixel(self, point: FloatArray, width: int, height: int) -> tuple[float, float]:
        """Where a point (3,) mm is seen."""
        right, up, _ = self.axes
        away, scale = point - self.centre, self.mm_per_pixel(width, height)
        return 0.5 * width + float(away @ right) / scale, 0.5 * height - float(away @ up) / scale

    def ray(self, x: float, y: float, width: int, height: int) -> tuple[FloatArray, FloatArray]:
        """A point (3,) mm before everything under a pixel, and the direction (3,) in which it looks."""
        right, up, towards = self.axes
        scale = self.mm_per_pixel(width, height)
        at = self.centre + (x - 0.5 * width) * scale * right + (0.5 * height - y) * scale * up
        return at + 10.0 * self.half * towards, -towards


def first_hit(
    points: FloatArray, faces: IntArray, origin: FloatArray, direction: FloatArray
) -> tuple[int, FloatArray] | None:
    """The first face of a surface (n, 3), (f, 3) that a ray meets, and where, barycentric (3,); None where it meets none.

    Moeller & Trumbore (1997), J. Graphics Tools 2:21, all faces at once.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    first, second = b - a, c - a
    p = np.cross(direction, second)
    determinant = np.einsum("fi,fi->f", first, p)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origin - a
        u = np.einsum("fi,fi->f", s, p) / determinant
        q = np.cross(s, first)
        v = (q @ direction) / determinant
        t = np.einsum("fi,fi->f", second, q) / determinant
        hit = (np.abs(determinant) > 1e-12) & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    if not hit.any():
        return None
    face = int(np.flatnonzero(hit)[np.argmin(t[hit])])
    return face, np.array([1.0 - u[face] - v[face], u[face], v[face]])
