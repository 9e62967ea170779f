"""Noise and weights of a lone surface, for the paper's studies: no walls' contours, no sizes estimated.

- Noise (`contour_covariance`): a person's contour errs smoothly, with sd^2 exp(-r^2 / (2 l^2)) between points r apart.
  Voxels, surface extraction and the model's mesh add errors with a correlation length of a few voxels.
- Weights (`weighting_covariance`): sd^2 exp(-r / (0.7 l)). The inverse of the smooth kernel trusts fine detail without
  limit, where mesh and voxel surface are wrong: on a pair without noise it moved ln G by 0.5, the exponential kernel by
  0.02. The price is a quarter more spread under noise that is perfectly smooth.

The spread of the estimate is that of these weights under that noise (sandwich formula; White 1982). Both scans have a
contour, so the variance counts twice.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_noise import (
    EXTRACTION_LENGTH_MM,
    EXTRACTION_MM,
    matern_3_2,
    smooth_covariance,
)

# Length of the weighting kernel over the correlation length: shorter trusts fine detail less and spreads more. Among
# 0.4 to 1, 0.7 halves what extraction errors do to ln G (0.10 to 0.05) at 5 % more spread.
WEIGHT_LENGTH = 0.7
# Keeps the weighting well conditioned where points nearly coincide, mm.
NUGGET_MM = 0.15


def contour_covariance(points: FloatArray, sd_mm: float, correlation_mm: float) -> FloatArray:
    """Covariance (q, q) mm2 of the residual between two contours: smooth errors of both, and extraction with a Matern
    3/2 kernel.

    points : (q, 3) mm. sd_mm, correlation_mm : of one contour's smooth error.
    """
    short = matern_3_2(cdist(points, points), EXTRACTION_LENGTH_MM)
    return 2.0 * smooth_covariance(points, sd_mm, correlation_mm) + EXTRACTION_MM**2 * short


def weighting_covariance(
    points: FloatArray, sd_mm: float, correlation_mm: float, nugget_mm: float = NUGGET_MM
) -> FloatArray:
    """Covariance (q, q) mm2 whose inverse weighs the residual between two contours; see the module's docstring. sd_mm :
    of one contour."""
    covariance = 2.0 * sd_mm**2 * np.exp(-cdist(points, points) / (WEIGHT_LENGTH * correlation_mm))
    covariance[np.diag_indices_from(covariance)] += nugget_mm**2
    return covariance
