"""Analytic solids by their signed distance: what the phantom is built of.

Distances are negative inside and, near the surface, true to first order (value over gradient), which is all that a
smooth edge and a label need.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from palpate.core.arrays import FloatArray

Triple = tuple[float, float, float]
Bounds = tuple[FloatArray, FloatArray]


class Solid(Protocol):
    """A solid in mm."""

    def distance(self, points: FloatArray) -> FloatArray:
        """Signed distance (n,) mm of points (n, 3), negative inside."""

    @property
    def bounds(self) -> Bounds:
        """Lowest and highest corner (3,) mm of a box that holds the solid; infinite where it has no end."""


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid with axes along x, y, z; ``power`` above 2 makes it boxier (a superellipsoid)."""

    centre: Triple
    radii: Triple
    power: float = 2.0

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        q = np.abs(points - np.array(self.centre)) / np.array(self.radii)
        return _over_gradient(q, np.array(self.radii), self.power)

    @property
    def bounds(self) -> Bounds:
        """See `Solid.bounds`."""
        return np.subtract(self.centre, self.radii), np.add(self.centre, self.radii)


@dataclass(frozen=True)
class Trunk:
    """An endless column along z whose section has its own semi-axis in each of four directions.

    centre : x, y mm. left, right, front, back : semi-axes mm. power : of the superellipse.
    """

    centre: tuple[float, float]
    left: float
    right: float
    front: float
    back: float
    power: float = 2.4

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        d = points[:, :2] - np.array(self.centre)
        radii = np.column_stack(
            [np.where(d[:, 0] > 0, self.left, self.right), np.where(d[:, 1] > 0, self.back, self.front)]
        )
        return _over_gradient(np.abs(d) / radii, radii, self.power)

    @property
    def bounds(self) -> Bounds:
        """See `Solid.bounds`."""
        x, y = self.centre
        return np.array([x - self.right, y - self.front, -np.inf]), np.array([x + self.left, y + self.back, np.inf])


@dataclass(frozen=True)
class Capsule:
    """A rounded cone around the segment from ``start`` to ``end``, with a radius at each end."""

    start: Triple
    end: Triple
    radius: float
    end_radius: float | None = None

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        a, axis = np.array(self.start), np.subtract(self.end, self.start)
        t = np.clip((points - a) @ axis / (axis @ axis), 0.0, 1.0)
        last = self.radius if self.end_radius is None else self.end_radius
        away = points - a - t[:, None] * axis
        return np.sqrt((away * away) @ np.ones(3)) - (self.radius + t * (last - self.radius))

    @property
    def bounds(self) -> Bounds:
        """See `Solid.bounds`."""
        widest = max(self.radius, self.end_radius or 0.0)
        return np.minimum(self.start, self.end) - widest, np.maximum(self.start, self.end) + widest


@dataclass(frozen=True)
class Tube:
    """A tube along z: knots of rising z with the centre's x, y and the section's semi-axes in x and y, joined by splines."""

    knots: tuple[tuple[float, float, float, float, float], ...]

    @cached_property
    def _curve(self) -> CubicSpline:
        table = np.array(self.knots)
        return CubicSpline(table[:, 0], table[:, 1:], bc_type="natural")

    def section(self, z: FloatArray) -> FloatArray:
        """Centre x, y and semi-axes (n, 4) mm at heights z (n,); constant beyond the knots."""
        return np.asarray(self._curve(np.clip(z, self.knots[0][0], self.knots[-1][0])))

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        s = self.section(points[:, 2])
        inside = (self.knots[0][0] < points[:, 2]) & (points[:, 2] < self.knots[-1][0])
        slope = np.where(inside[:, None], self._curve(np.clip(points[:, 2], -1e3, 1e3), 1)[:, :2], 0.0)
        across = _over_gradient(np.abs(points[:, :2] - s[:, :2]) / s[:, 2:], s[:, 2:], 2.0)
        return across / np.sqrt(1.0 + (slope**2).sum(axis=1))

    @property
    def bounds(self) -> Bounds:
        """See `Solid.bounds`."""
        z = np.linspace(self.knots[0][0], self.knots[-1][0], 100)
        s = self.section(z)
        low, high = (s[:, :2] - s[:, 2:]).min(axis=0), (s[:, :2] + s[:, 2:]).max(axis=0)
        return np.append(low, -np.inf), np.append(high, np.inf)


def near(points: FloatArray, solid: Solid, margin_mm: float) -> NDArray[np.intp]:
    """Indices of the points within ``margin_mm`` of the solid's box."""
    low, high = solid.bounds
    kept = np.arange(len(points))
    for axis in range(3):
        if np.isfinite(low[axis]):
            along = points[kept, axis] if axis else points[:, 0]
            kept = kept[(along > low[axis] - margin_mm) & (along < high[axis] + margin_mm)]
    return kept


def _over_gradient(q: FloatArray, radii: FloatArray, power: float) -> FloatArray:
    """(|q|_p - 1) over the length of its gradient: the signed distance near |q|_p = 1, for q = |x| / radii (n, d) >= 0."""
    ones = np.ones(q.shape[1])
    length = np.maximum(((q * q if power == 2.0 else q**power) @ ones) ** (1.0 / power), 1e-9)
    slope = q / length[:, None]
    slope = (slope if power == 2.0 else slope ** (power - 1.0)) / radii
    return (length - 1.0) / np.maximum(np.sqrt((slope * slope) @ ones), 1e-9)
