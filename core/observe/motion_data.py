"""Data that matched points are: one for each direction that a point tells.

The precision of a point's displacement is rotated to its eigenvectors e_a with standard deviations s_a; a direction
with a large one is no datum. The datum is e_a . u. Windows overlap, so that errors of neighbouring points go along: with
C^(1/2) z for the error of a point, and z a unit field with correlation rho(d) in each axis, the covariance of data a and
b is s_a s_b (e_a . e_b) rho(d_ab), which is positive definite as rho is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.spatial.distance import cdist

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.contour_noise import noise_modes

# Directions with a larger standard deviation, mm, are no data: they know less than the model before it sees anything.
LARGEST_SD_MM = 3.0
# Independent part of every datum's error, as a share of its standard deviation: keeps the covariance well conditioned
# where points nearly coincide.
_NUGGET = 0.1
# Modes: correlation length of the motion that they hold, mm (that of a missing force, `NoiseModelOptions`; the motion that
# forces cause is smoother); share of its variance that is kept; the least signal over noise of one, and the most of them.
_LENGTH_MM, _KEPT, _LEAST, _MOST = 12.0, 0.999, 0.05, 300


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

    def along(self, vectors: FloatArray) -> FloatArray:
        """Components (d,) of vectors (p, 3) at the points in the data's directions."""
        return np.asarray(np.einsum("di,di->d", vectors[self.point], self.direction))

    def covariance(self) -> FloatArray:
        """Covariance (d, d) mm2 of the errors."""
        at = self.points[self.point]
        together = np.exp(-((cdist(at, at) / self.correlation_mm) ** 2)) * (self.direction @ self.direction.T)
        together = (1.0 - _NUGGET**2) * together
        together[np.diag_indices_from(together)] = 1.0
        return np.asarray(self.sd[:, None] * together * self.sd)


def mode_reader(data: MotionData) -> FloatArray:
    """Matrix (m, d) that takes data to modes of unit variance and independent errors, the best known first.

    A thousand points are some hundred independent observations of a smooth motion. The data are whitened by their own
    covariance, and projected on the directions in which smooth motion of 1 mm shows most above their noise; the remainder
    is finer than any motion that forces cause.
    """
    if not len(data.sd):
        return np.zeros((0, 0))
    factor = cholesky(data.covariance(), lower=True)
    modes = noise_modes(data.points, 1.0, _LENGTH_MM, _KEPT)[data.point]
    shown = np.concatenate([modes * data.direction[:, a : a + 1] for a in range(3)], axis=1)
    signal = solve_triangular(factor, shown, lower=True)
    square, turn = np.linalg.eigh(signal.T @ signal)
    kept = np.flatnonzero(square > _LEAST)[::-1][:_MOST]
    whole = signal @ (turn[:, kept] / np.sqrt(square[kept]))
    return np.asarray(solve_triangular(factor, whole, lower=True, trans="T").T)
