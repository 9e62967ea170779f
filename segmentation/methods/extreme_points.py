"""What the six outermost points of an organ say of its shape (extreme points: Papadopoulos et al., ICCV 2017)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.segmentation.methods.star_surface import sphere

# How much of the tilt and taper that the points show is believed: a point may lie anywhere on a flat side.
TILT_TRUST, MOST_TILT, MOST_TAPER = 0.7, 0.6, 0.6
# Beyond the ends a taper goes on for this share of half the height, and no section becomes narrower than the next share.
TAPER_ENDS, NARROWEST = 1.2, 0.2
# Contours are boxier than ellipsoids, whose power is 2: they end in a slice that still has some area.
POWER = 2.3


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """centre : (3,) mm. semi : (3,) mm half the extent along LPS. matrix : (3, 3) mm2, its shape. Its ends along z are
    blunt: sections narrow towards them as (1 - |h|^POWER)^(1/2), h the height as a share of half the extent.

    taper : by how much sections widen from the middle to the upper end, as a share; below, they narrow alike.
    """

    centre: FloatArray
    semi: FloatArray
    matrix: FloatArray
    taper: float = 0.0

    def level(self, axes: tuple[FloatArray, FloatArray, FloatArray]) -> FloatArray:
        """0 at the centre, 1 on the surface, on a grid whose coordinates x, y, z mm broadcast over it."""
        return self.level_of(np.stack(np.broadcast_arrays(*axes), axis=-1) - self.centre)

    def level_of(self, away: FloatArray) -> FloatArray:
        """The same (...) at places (..., 3) mm from the centre."""
        axis = self.matrix[:, 2] / self.matrix[2, 2]
        height = np.clip(away[..., 2] / self.semi[2], -TAPER_ENDS, TAPER_ENDS)
        wide = np.maximum((1.0 + self.taper * height) / self._widest, NARROWEST)
        wide = (wide * _bluntness(away[..., 2] / self.semi[2]))[..., None]
        on_axis = away[..., 2:3] * axis
        whiten = np.linalg.inv(np.linalg.cholesky(self.matrix))
        return np.asarray(np.linalg.norm((on_axis + (away - on_axis) / wide) @ whiten.T, axis=-1))

    def radii(self) -> FloatArray:
        """Radii (642,) mm along the directions of `star.sphere`, by halving."""
        directions = sphere().points
        low, high = np.zeros(len(directions)), np.full(len(directions), 3.0 * self.semi.max())
        for _ in range(40):
            middle = 0.5 * (low + high)
            inside = self.level_of(directions * middle[:, None]) < 1.0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return 0.5 * (low + high)

    @property
    def _widest(self) -> float:
        """What the widest section's width is multiplied by: it shall be as wide as the points are apart."""
        height = np.linspace(-1.0, 1.0, 201)
        return float((np.sqrt(1.0 - height**2) * _bluntness(height) * (1.0 + self.taper * height)).max())


def _bluntness(height: FloatArray) -> FloatArray:
    """By how much a section is wider than the ellipsoid's, at heights in units of half the extent; as at the end beyond it."""
    share = np.minimum(np.abs(height), 1.0 - 1e-6)
    return np.asarray(np.sqrt((1.0 - share**POWER) / (1.0 - share**2)))


def ellipsoid_of(points: FloatArray) -> Ellipsoid:
    """The ellipsoid whose outermost points along x, y and z are the given ones (6, 3) mm, in any order.

    An ellipsoid of shape A is outermost along axis i at A[:, i] / sqrt(A[i, i]): the points give extent and tilt. Where the
    points at the sides, front and back lie above the middle on the whole, sections narrow downwards: one that widens by a
    share k from the middle up is widest at about k of half its height.
    """
    low, high = points[points.argmin(axis=0)], points[points.argmax(axis=0)]
    centre, semi = 0.5 * (np.diag(low) + np.diag(high)), 0.5 * (np.diag(high) - np.diag(low))
    tilt = 0.25 * semi[:, None] * (high - low)
    most = MOST_TILT * np.outer(semi, semi)
    matrix = np.clip(TILT_TRUST * (tilt + tilt.T), -most, most)
    np.fill_diagonal(matrix, semi**2)
    # Three tilts that do not go together make no ellipsoid: they are lessened until they do.
    while np.linalg.eigvalsh(matrix).min() < 0.05 * (semi**2).min():
        matrix = 0.8 * matrix + 0.2 * np.diag(semi**2)
    aside = np.concatenate([low[:2, 2], high[:2, 2]]).mean()
    taper = TILT_TRUST * float(np.clip((aside - centre[2]) / semi[2], -MOST_TAPER, MOST_TAPER))
    return Ellipsoid(centre, semi, matrix, taper)
