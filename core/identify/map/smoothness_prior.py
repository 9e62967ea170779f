"""Prior of a stiffness map: a free common level and smooth differences from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import matern_3_2

# Prior of the differences: within a factor of two with a probability of 68 %; correlation length, about the size of a focus.
LOCAL_SD = float(np.log(2.0))
LENGTH_MM = 12.0


@dataclass(frozen=True)
class SmoothPrior:
    """Gaussian prior of the field ln G (G in kPa).

    mean : of the level. level_sd : standard deviation of the common level. local_sd : standard deviation of the field
    about the level. length_mm : length of its Matern 3/2 kernel.
    """

    mean: float
    level_sd: float
    local_sd: float = LOCAL_SD
    length_mm: float = LENGTH_MM

    @classmethod
    def of_bounds(cls, bounds_kpa: tuple[float, float]) -> SmoothPrior:
        """Prior whose level has the mean and the standard deviation of a flat prior of ln G between the bounds."""
        low, high = np.log(bounds_kpa)
        return cls(float(0.5 * (low + high)), float((high - low) / np.sqrt(12.0)))

    def covariance(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """(p, q) covariance of ln G between places a (p, 3) and b (q, 3) mm."""
        return self.level_sd**2 + self.local_covariance(a, b)

    def local_covariance(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """(p, q) covariance of the differences from the level, between places a (p, 3) and b (q, 3) mm."""
        return self.local_sd**2 * matern_3_2(cdist(a, b), self.length_mm)
