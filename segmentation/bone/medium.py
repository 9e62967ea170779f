"""Contrast medium that is as dense as bone: a fluid, and so even where bone is not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import FloatArray
from palpate.segmentation.working_grid import Mask, dilated, eroded

# Half the width of what counts as a pool of fluid, mm, the least of its inside, and how far beyond that inside it reaches: that width, the
# windows of roughness and a soft kernel; on two pelves nothing changed between 9 and 12.
DEEP_MM, SMALLEST_CC, RIM_MM = 4.0, 1.0, 10.0
# Muscle's HU, whose roughness is the picture's noise; a fluid is not this many times rougher. Marrow was 5 to 30 times so, and where
# noise of 19 HU hides its roughness still 2.1 times.
MUSCLE_HU, ROUGHER = (-10.0, 100.0), 1.5
# So far from the middle of all that is dense a bladder may lie, mm; even marrow of a hip lay 60 mm and more from it.
MIDLINE_MM = 40.0
# Window in which roughness is measured, voxels.
WINDOW = 3


def medium_mask(hu: NDArray[np.floating], dense: Mask, step_mm: float) -> Mask:
    """Which part of what is as dense as bone is medium in a bladder; nothing where none is.

    hu : on an even upright grid. dense : what may be bone. Medium is as even as muscle is, and lies in front of the sacrum and
    about the midline.
    """
    medium = np.zeros_like(dense)
    inside = eroded(dense, DEEP_MM, step_mm)
    muscle = eroded((hu > MUSCLE_HU[0]) & (hu < MUSCLE_HU[1]), DEEP_MM, step_mm)
    if not inside.any() or not muscle.any():
        return medium
    rough = _roughness(hu)
    noise = float(np.median(rough[muscle]))
    rows = np.flatnonzero(dense.any(axis=(0, 2)))
    weight = dense.sum(axis=(0, 2))[rows]
    share = np.cumsum(weight) / weight.sum()
    midline = float((np.arange(len(dense)) * dense.sum(axis=(1, 2))).sum() / dense.sum())
    behind = 0.5 * (np.interp(0.5, share, rows) + np.interp(0.95, share, rows))
    # Place by place: where little fat lies between them a full bladder and the bones about it are one piece.
    parts, count = ndimage.label(inside & (ndimage.uniform_filter(rough, WINDOW) < ROUGHER * noise))
    for number, box in enumerate(ndimage.find_objects(parts, count), 1):
        part = parts[box] == number
        x, y = (box[axis].start + float(np.argwhere(part)[:, axis].mean()) for axis in (0, 1))
        large = part.sum() * step_mm**3 >= SMALLEST_CC * 1000.0
        if large and y < behind and abs(x - midline) * step_mm < MIDLINE_MM:
            medium[box] |= part
    return dilated(medium, RIM_MM, step_mm) & dense


def _roughness(hu: NDArray[np.floating]) -> FloatArray:
    """Standard deviation in a window about each voxel, HU."""
    wide = hu.astype(np.float64)
    square, mean = ndimage.uniform_filter(wide**2, WINDOW), ndimage.uniform_filter(wide, WINDOW)
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))
