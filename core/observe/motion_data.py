"""Data that matched points are: one for each direction that a point tells.

The precision of a point's displacement is rotated to its eigenvectors e_a with standard deviations s_a; a direction
with a large one is no datum. The datum is e_a . u. Windows overlap, so that errors of neighbouring points go along: with
C^(1/2) z for the error of a point, and z a unit field with correlation rho(d) in each axis, the covariance of data a and
b is s_a s_b (e_a . e_b) rho(d_ab), which is positive definite as rho is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.matched_motion import MatchedMotion

# Directions with a larger standard deviation, mm, are no data: they know less than the model before it sees anything.
LARGEST_SD_MM = 3.0
# Independent part of every datum's error, as a share of its standard deviation: keeps the covariance well conditioned
# where points nearly coincide.
NUGGET = 0.1


@dataclass(frozen=True, eq=False)
class MotionData:
    """points : (p, 3) mm at rest; moved (p, 3) mm. point : (d,) the point that each datum is of.

    direction : (d, 3) unit vectors. sd : (d,) mm. correlation_mm : see `MatchedMotion`.
    """

    points: FloatArray
    moved: FloatArray
    point: IntArray
    direction: FloatArray
    sd: FloatArray
    correlation_mm: float

    @classmethod
    def of(cls, matched: MatchedMotion | None, usable: BoolArray | None = None) -> MotionData:
        """The data of a match's usable (n,) points, of all where None; none where nothing was matched."""
        if matched is None:
            empty = np.zeros((0, 3))
            return cls(empty, empty, np.zeros(0, dtype=np.int64), empty, np.zeros(0), 1.0)
        usable = np.ones(len(matched.points), dtype=bool) if usable is None else usable
        value, vector = np.linalg.eigh(matched.precision[usable])
        point, axis = np.nonzero(value > LARGEST_SD_MM**-2)
        direction, sd = vector[point, :, axis], 1.0 / np.sqrt(value[point, axis])
        return cls(matched.points[usable], matched.moved[usable], point, direction, sd, matched.correlation_mm)

    def components(self, vectors: FloatArray) -> FloatArray:
        """Components (d,) of vectors (p, 3) at the points in the data's directions."""
        return np.asarray(np.einsum("di,di->d", vectors[self.point], self.direction))

    def covariance(self) -> FloatArray:
        """Covariance (d, d) mm2 of the errors."""
        at = self.points[self.point]
        together = np.exp(-((cdist(at, at) / self.correlation_mm) ** 2)) * (self.direction @ self.direction.T)
        together = (1.0 - NUGGET**2) * together
        together[np.diag_indices_from(together)] = 1.0
        return np.asarray(self.sd[:, None] * together * self.sd)
