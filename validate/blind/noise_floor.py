"""The noise floor of the blind check: what a case without any effect leaves between its scans and a model that is right."""

from __future__ import annotations

import numpy as np

# What voxels, walls that move unseen along themselves and the mesh leave beside the contours' noise, rms mm: about what
# `gap.noise_floor_mm` of effect-free cases has over the noise of two contours.
LEFT_MM = 0.3


def noise_floor_mm(noise_mm: float) -> float:
    """rms mm, for contours of noise_mm each: an organ's motion is the difference of two, and no contour is all that errs."""
    return float(np.hypot(np.sqrt(2.0) * noise_mm, LEFT_MM))


def noise_whose_floor_is(floor_mm: float) -> float:
    """Standard deviation of one contour, mm, above which `noise_floor_mm` is more than floor_mm; 0 where it always is."""
    return float(np.sqrt(max(floor_mm**2 - LEFT_MM**2, 0.0) / 2.0))
