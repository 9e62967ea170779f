"""Errors of one contour in two scans, at points of its surface: what each scan errs by, and what they have in common.

The error of the rest scan is a z0 + r z1, that of the deformed one b z0 + d z2: z0, z1, z2 are independent smooth fields of
unit variance, and a, b, r, d standard deviations by place. A residual sees their difference, from which what both have
alike drops out. A contour that was carried over from one scan to the other errs there as it does in the first (a = b), and
by what carried it beside that.
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
    """points (q, 3) mm at rest. rest, deformed (q,) mm : standard deviations along the normal of what each scan errs by alone
    (r, d). common (2, q) mm : of what both have in common, as it is at rest and in the deformed scan (a, b)."""

    points: FloatArray
    rest: FloatArray
    deformed: FloatArray
    common: FloatArray

    @classmethod
    def even(cls, points: FloatArray, sd_mm: float) -> ContourErrors:
        """The same error everywhere, nothing of it common, at points (q, 3) mm."""
        return cls.sharing(points, np.full((2, len(points)), sd_mm), 0.0)

    @classmethod
    def sharing(cls, points: FloatArray, sd_mm: FloatArray, share: float) -> ContourErrors:
        """sd_mm (2, q) : of the whole error at rest and in the deformed scan. share : of its variance that both have in common."""
        rest, deformed = np.sqrt(1.0 - share) * sd_mm
        return cls(points, rest, deformed, np.sqrt(share) * sd_mm)

    @classmethod
    def of(cls, pair: SurfacePair, points: FloatArray, moved: FloatArray, otherwise_mm: float) -> ContourErrors:
        """Errors that the surfaces state, at points (q, 3) mm of the rest surface that lie at `moved` (q, 3) mm in the
        deformed scan. otherwise_mm : of a surface that states none."""
        sd = np.stack([_at(pair.rest, points, otherwise_mm), _at(pair.deformed, moved, otherwise_mm)])
        none = np.zeros(len(points))
        if pair.carried_to == "deformed":
            return cls(points, none, sd[1], np.stack([sd[0], sd[0]]))
        if pair.carried_to == "rest":
            return cls(points, sd[0], none, np.stack([sd[1], sd[1]]))
        return cls.sharing(points, sd, pair.common_share if pair.states_errors else 0.0)

    def part(self, chosen: IntArray) -> ContourErrors:
        """The errors at some of the points."""
        return ContourErrors(self.points[chosen], self.rest[chosen], self.deformed[chosen], self.common[:, chosen])

    @property
    def difference(self) -> FloatArray:
        """Standard deviation (q,) mm of the difference of both scans' errors."""
        return np.sqrt(self.rest**2 + self.deformed**2 + (self.common[1] - self.common[0]) ** 2)

    def covariance(self, other: ContourErrors, length_mm: float, same_state: bool) -> FloatArray:
        """Covariance (p, q) mm2 of the differences of both scans' errors, between these points and another state's.

        same_state : False for two deformed states, which have the scan at rest in common. length_mm : correlation length
        of the fields.
        """
        size = np.outer(self.rest, other.rest)
        size += np.outer(self.common[1] - self.common[0], other.common[1] - other.common[0])
        if same_state:
            size += np.outer(self.deformed, other.deformed)
        return size * covariance_between(self.points, other.points, 1.0, length_mm)


def _at(surface: Surface, points: FloatArray, otherwise_mm: float) -> FloatArray:
    """Standard deviation (q,) mm at the surface's vertex nearest to each point (q, 3) mm."""
    if surface.sd_mm is None:
        return np.full(len(points), otherwise_mm)
    return np.asarray(surface.sd_mm[cKDTree(surface.points).query(points)[1]], dtype=np.float64)
