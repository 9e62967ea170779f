"""What is believed of a stiffness map before the scans: a level that may be anything allowed, and smooth differences about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import matern_3_2

# A region's stiffness differs from the organ's level by a factor of two or less in two cases of three; a focus is about this long.
LOCAL_SD = float(np.log(2.0))
LENGTH_MM = 12.0


@dataclass(frozen=True)
class SmoothPrior:
    """Gaussian field of ln G (G in kPa): mean, a common level of standard deviation level_sd, and about it a field of standard
    deviation local_sd with the Matern 3/2 kernel of length_mm."""

    mean: float
    level_sd: float
    local_sd: float = LOCAL_SD
    length_mm: float = LENGTH_MM

    @classmethod
    def of_bounds(cls, bounds_kpa: tuple[float, float]) -> SmoothPrior:
        """The level as spread as a flat one between the bounds."""
        low, high = np.log(bounds_kpa)
        return cls(float(0.5 * (low + high)), float((high - low) / np.sqrt(12.0)))

    def covariance(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """(p, q) of ln G between places a (p, 3) and b (q, 3) mm."""
        return self.level_sd**2 + self.local_covariance(a, b)

    def local_covariance(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """(p, q) of the differences about the level."""
        return self.local_sd**2 * matern_3_2(cdist(a, b), self.length_mm)
