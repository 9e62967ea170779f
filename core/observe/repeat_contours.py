"""Standard deviation and correlation length of contour noise, from an organ drawn twice on one scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.distance import pdist

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.observe.contour_noise import EXTRACTION_MM
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.statistics import rms
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.core.surfaces.surface import Surface

# Two drawings further apart than this (rms mm) are not of one organ on one scan.
MOST_MM = 5.0
# Least that is believed of a person, mm.
LEAST_MM = 0.1
# Resolution: distance of the points that are compared, mm.
_SPACING_MM = 2.0
# Distances between points at which two errors are compared: beyond the surface extraction's own reach, within an
# organ's.
_NEAR_MM, _FAR_MM = 3.0, 20.0
# Correlation lengths among which the best is taken, mm: a quarter of a millimetre apart.
_LENGTHS_MM = np.linspace(3.0, 15.0, 49)


@dataclass(frozen=True)
class Repeat:
    """Noise of one contour along its normal: sd_mm, and correlation_mm, the l of exp(-r^2 / (2 l^2)). apart_mm : rms
    distance of the two."""

    sd_mm: float
    correlation_mm: float
    apart_mm: float


def repeat_of(first: Surface, second: Surface) -> Repeat:
    """Noise of one contour from two surfaces of one organ on one scan, whose errors are independent.

    What extraction from voxels adds (`contour_noise.EXTRACTION_MM`) is subtracted.

    Raises InputError when they are too far apart to be two drawings of one organ.
    """
    points = sample_surface(first, _SPACING_MM)[0]
    distance = SignedDistanceField.from_surface(second.points, second.faces).value_and_gradient(points)[0]
    apart = rms(distance)
    if apart > MOST_MM:
        raise InputError(f"the two drawings are {apart:.1f} mm apart; give the same organ drawn twice on the same scan")
    sd = np.sqrt(max(apart**2 - EXTRACTION_MM**2, 0.0) / 2.0)
    return Repeat(max(float(sd), LEAST_MM), _length(points, distance), apart)


def _length(points: FloatArray, distance: FloatArray) -> float:
    """Correlation length l, mm: least-squares fit of a Gaussian of free height to the products of errors at pairs of
    points."""
    r = pdist(points)
    i, j = np.triu_indices(len(points), 1)
    use = (r > _NEAR_MM) & (r < _FAR_MM)
    product, r = (distance[i] * distance[j])[use], r[use]
    curves = np.exp(-0.5 * (r[None] / _LENGTHS_MM[:, None]) ** 2)
    height = np.maximum(curves @ product / (curves**2).sum(axis=1), 0.0)
    gain = 2.0 * height * (curves @ product) - height**2 * (curves**2).sum(axis=1)
    return float(_LENGTHS_MM[np.argmax(gain)])
