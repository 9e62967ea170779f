"""What of a scan has a counterpart in another scan of the same patient, and spots that show well."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.labels import BLADDER, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume

# HU: gas and everything outside the body lies below the first, bone above the second, metal above the third.
GAS_HU, BONE_HU, METAL_HU = -200.0, 250.0, 2000.0
# Margin about gas, bone and what hollow organs hold, mm: as far as contours and partial volume may be off; and about
# metal, whose streaks reach farther.
RIM_MM, METAL_RIM_MM = 2.5, 8.0
# A bright spot exceeds the organ's median by so many of its standard deviations (robust); at most so many are taken,
# none within this many mm of a brighter one.
_BRIGHT, _MOST, _APART_MM = 6.0, 20, 5.0


def usable_voxels(ct: Volume, labels: Volume) -> BoolArray:
    """Mask (ni, nj, nk) of what moves along with the body, from HU and from labels on the same grid.

    Bladder and rectum are left out whole: their walls are thin, and their contents change. Within the organ bone and metal
    count, for they are calcifications and markers.
    """
    organ = np.isin(labels.array, ORGAN_LABELS)
    none = np.isin(labels.array, (BLADDER, RECTUM)) | (ct.array < GAS_HU) | ((ct.array > BONE_HU) & ~organ)
    usable = _distance_to(none, ct.spacing) > RIM_MM
    metal = (ct.array > METAL_HU) & ~organ
    return np.asarray(usable & (_distance_to(metal, ct.spacing) > METAL_RIM_MM))


def bright_spots(ct: Volume, labels: Volume) -> FloatArray:
    """Patient coordinates (b, 3) mm of the organ's calcifications and markers: local maxima of HU, the brightest first."""
    organ = np.isin(labels.array, ORGAN_LABELS)
    if not organ.any():
        return np.zeros((0, 3))
    inside = ct.array[organ].astype(float)
    middle = float(np.median(inside))
    sd = 1.4826 * float(np.median(np.abs(inside - middle)))
    size = tuple(2 * int(np.ceil(_APART_MM / s)) + 1 for s in ct.spacing)
    top = organ & (ct.array >= middle + _BRIGHT * max(sd, 1.0)) & (ct.array == ndimage.maximum_filter(ct.array, size))
    index = np.argwhere(top)
    order = np.argsort(-ct.array[tuple(index.T)].astype(float), kind="stable")[:_MOST]
    return ct.to_lps(index[order].astype(float))


def distance_to_organ(labels: Volume) -> FloatArray:
    """Distance (ni, nj, nk) mm of every voxel from the organ, 0 inside."""
    return _distance_to(np.isin(labels.array, ORGAN_LABELS), labels.spacing)


def _distance_to(mask: BoolArray, spacing: FloatArray) -> FloatArray:
    if not mask.any():
        return np.full(mask.shape, np.inf)
    return np.asarray(ndimage.distance_transform_edt(~mask, sampling=spacing), dtype=np.float64)
