"""How the walls of hollow organs are moved in a simulation: smooth known displacements of the whole organ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.surfaces.surface import Surface
from palpate.imaging.volume import Volume

# The motion dies away over this distance before the edge of the modelled region, which does not move.
FADE_MM = 14.0
# Radius within which the inflation of a tube falls to nothing at its centre line.
CORE_MM = 8.0


class WallMotion(Protocol):
    """A smooth displacement of a hollow organ: its wall and what it holds."""

    def displacement(self, points: FloatArray) -> FloatArray:
        """Displacement (n, 3) mm of points (n, 3) mm at rest, in or on the organ."""


@dataclass(frozen=True, eq=False)
class TubeMotion:
    """A tube along z blown up around its centre line, as by a balloon, and pushed.

    centre : z (n,) -> x, y (n, 2) mm. inflate_mm : mean growth of the radius in the middle; in direction e (x, y) it is
    inflate_mm (1 + e . bias). push_mm : (3,) shift there.
    middle_z, half_length : mm; the motion is a cosine squared of z, nothing beyond half_length.
    """

    centre: Callable[[FloatArray], FloatArray]
    inflate_mm: float
    bias: FloatArray
    push_mm: FloatArray
    middle_z: float
    half_length: float

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        z = points[:, 2]
        window = np.cos(0.5 * np.pi * np.clip((z - self.middle_z) / self.half_length, -1.0, 1.0)) ** 2
        away = points[:, :2] - self.centre(z)
        radial = away / np.sqrt((away**2).sum(axis=1, keepdims=True) + CORE_MM**2)
        growth = self.inflate_mm * (1.0 + radial @ self.bias)
        moved = np.column_stack([growth[:, None] * radial, np.zeros(len(z))]) + self.push_mm
        return window[:, None] * moved


@dataclass(frozen=True, eq=False)
class BagMotion:
    """A bag that fills or empties while one point of it stays: u = (scale - 1) (x - anchor) + push."""

    anchor: FloatArray
    scale: float
    push_mm: FloatArray

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        return (self.scale - 1.0) * (points - self.anchor) + self.push_mm


@dataclass(frozen=True, eq=False)
class Faded:
    """A motion that vanishes at the edge of the modelled region. depth : volume of mm to that edge, 0 outside."""

    motion: WallMotion
    depth: Volume

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        t = np.clip(self.depth.at(points) / FADE_MM, 0.0, 1.0)
        return self.motion.displacement(points) * (t * t * (3.0 - 2.0 * t))[:, None]


@dataclass(frozen=True, eq=False)
class MovedWall:
    """A wall at rest, within the modelled region, and its motion."""

    surface: Surface
    motion: WallMotion

    @property
    def volume_change(self) -> float:
        """What the organ takes in, mm3; right for open walls too, as their rims do not move."""
        moved = self.surface.points + self.motion.displacement(self.surface.points)
        after = self.surface.with_points(moved)
        return after.enclosed_volume - self.surface.enclosed_volume
