"""Solids made of solids: joined, hollowed, cut, taken from one another."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.simulate.phantom.solids import Bounds, Solid, Triple


@dataclass(frozen=True)
class Union:
    """Solids joined; within ``blend_mm`` of where two meet the crease is rounded out."""

    parts: Sequence[Solid]
    blend_mm: float = 0.0

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        total = self.parts[0].distance(points)
        for part in self.parts[1:]:
            other = part.distance(points)
            if self.blend_mm > 0.0:
                h = np.maximum(self.blend_mm - np.abs(total - other), 0.0)
                total = np.minimum(total, other) - h**2 / (4.0 * self.blend_mm)
            else:
                total = np.minimum(total, other)
        return total

    @property
    def bounds(self) -> Bounds:
        """See `Solid.bounds`."""
        boxes = [part.bounds for part in self.parts]
        low, high = np.min([b[0] for b in boxes], axis=0), np.max([b[1] for b in boxes], axis=0)
        return low - self.blend_mm, high + self.blend_mm


@dataclass(frozen=True)
class _Within:
    """What is left of a solid lies within its bounds."""

    solid: Solid

    @property
    def bounds(self) -> Bounds:
        """See `Solid.bounds`."""
        return self.solid.bounds


@dataclass(frozen=True)
class Shrunk(_Within):
    """The inside of a solid that lies deeper than ``depth_mm``: a lumen, a marrow space."""

    depth_mm: float

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        return self.solid.distance(points) + self.depth_mm


@dataclass(frozen=True)
class Cut(_Within):
    """The part of a solid on one side of a plane: where (x - point) . normal < 0."""

    point: Triple
    normal: Triple

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        normal = np.array(self.normal) / np.linalg.norm(self.normal)
        return np.maximum(self.solid.distance(points), (points - np.array(self.point)) @ normal)


@dataclass(frozen=True)
class Without(_Within):
    """A solid less another."""

    removed: Solid

    def distance(self, points: FloatArray) -> FloatArray:
        """See `Solid.distance`."""
        return np.maximum(self.solid.distance(points), -self.removed.distance(points))
