"""Errors of one contour in two scans, at points of its surface: what each scan errs by, and what they have in common.

The error of the rest scan is r (sqrt(c) z0 + sqrt(1 - c) z1), that of the deformed one d (sqrt(c) z0 + sqrt(1 - c) z2): z0,
z1, z2 are independent smooth fields of unit variance, r and d standard deviations by place, c the common share of the
variance. A residual sees their difference, from which what both have alike drops out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.observe.contour_noise import covariance_between
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.surface import Surface


@dataclass(frozen=True, eq=False)
class ContourErrors:
    """points (q, 3) mm at rest. rest, deformed (q,) mm : standard deviations along the normal. common : c."""

    points: FloatArray
    rest: FloatArray
    deformed: FloatArray
    common: float = 0.0

    @classmethod
    def even(cls, points: FloatArray, sd_mm: float) -> ContourErrors:
        """The same error everywhere, nothing of it common, at points (q, 3) mm."""
        sd = np.full(len(points), sd_mm)
        return cls(points, sd, sd)

    @classmethod
    def of(cls, pair: SurfacePair, points: FloatArray, moved: FloatArray, otherwise_mm: float) -> ContourErrors:
        """Errors that the surfaces state, at points (q, 3) mm of the rest surface that lie at `moved` (q, 3) mm in the
        deformed scan. otherwise_mm : of a surface that states none."""
        rest, deformed = _at(pair.rest, points, otherwise_mm), _at(pair.deformed, moved, otherwise_mm)
        return cls(points, rest, deformed, pair.common_share if pair.states_errors else 0.0)

    def part(self, chosen: IntArray) -> ContourErrors:
        """The errors at some of the points."""
        return ContourErrors(self.points[chosen], self.rest[chosen], self.deformed[chosen], self.common)

    def common_share(self, other: ContourErrors) -> float:
        """Share of the covariance with another state's errors that all scans have in common."""
        return float(np.sqrt(self.common * other.common))

    def own_share(self, other: ContourErrors) -> float:
        """Share of the covariance with another state's errors that each scan has by itself."""
        return float(np.sqrt((1.0 - self.common) * (1.0 - other.common)))

    def covariance(self, other: ContourErrors, length_mm: float, same_state: bool) -> FloatArray:
        """Covariance (p, q) mm2 of the differences of both scans' errors, between these points and another state's.

        same_state : False for two deformed states, which have the scan at rest in common. length_mm : correlation length
        of the fields.
        """
        alike, own = self.common_share(other), self.own_share(other)
        size = own * np.outer(self.rest, other.rest)
        size += alike * np.outer(self.deformed - self.rest, other.deformed - other.rest)
        if same_state:
            size += own * np.outer(self.deformed, other.deformed)
        return size * covariance_between(self.points, other.points, 1.0, length_mm)


def _at(surface: Surface, points: FloatArray, otherwise_mm: float) -> FloatArray:
    """Standard deviation (q,) mm at the surface's vertex nearest to each point (q, 3) mm."""
    if surface.sd_mm is None:
        return np.full(len(points), otherwise_mm)
    return np.asarray(surface.sd_mm[cKDTree(surface.points).query(points)[1]], dtype=np.float64)
