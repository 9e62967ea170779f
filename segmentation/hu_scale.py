"""The scale of a scan's HU, told by its own fat: scanners, beam energies and lost rescaling shift all tissue alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import Float32Array
from palpate.core.sourced_number import sourced
from palpate.segmentation.working_grid import AIR_HU, Mask, blurred

# Bins of the histogram and its smoothing, HU; and how much the picture is blurred first, mm.
_BIN_HU, _SMOOTH_BINS, _BLUR_MM = 4.0, 1.5, 2.0
_RANGE_HU = (-250.0, 250.0)


@dataclass(frozen=True, kw_only=True)
class ScaleOptions:
    """What is known of fat and muscle before a scan is seen."""

    fat_hu: Annotated[
        tuple[float, float],
        sourced(
            "HU",
            "Fat's usual values; a scan within them is left as it is.",
            "ICRP 110: adipose tissue at 0.95 g/cm3, -90 to -110 HU at 100 to 140 kV.",
        ),
    ] = (-110.0, -90.0)
    apart_hu: Annotated[
        tuple[float, float],
        sourced(
            "HU",
            "How far muscle lies above fat.",
            "Muscle of 20 (fatty) to 70 HU (with medium), fat as above, both 10 % off.",
        ),
    ] = (100.0, 200.0)
    most: Annotated[
        float,
        sourced("1", "Largest correction, as a share of HU + 1000.", "Chosen: what is off by more is no CT in HU."),
    ] = 0.15
    least_fat: Annotated[
        float,
        sourced(
            "1", "Height of fat's peak, as a share of muscle's, that is believed.", "Chosen: above counting noise."
        ),
    ] = 0.05


def scale_of(hu: NDArray[np.floating], body: Mask, step_mm: float, options: ScaleOptions | None = None) -> float:
    """By how much HU + 1000 of a scan is to be multiplied for its fat to have fat's HU; 1 where it has, or shows no fat.

    hu : on an even grid. body : what of it is the patient. Air keeps its HU, which every scanner is set by. Fat is told by
    being one of two peaks so far apart as fat and muscle are, of which the product of the heights is largest.
    """
    options = options or ScaleOptions()
    edges = np.arange(_RANGE_HU[0], _RANGE_HU[1] + _BIN_HU, _BIN_HU)
    count, _ = np.histogram(blurred(hu, _BLUR_MM, step_mm)[body], bins=edges)
    height = ndimage.gaussian_filter1d(count.astype(float), _SMOOTH_BINS)
    middle = 0.5 * (edges[1:] + edges[:-1])
    apart = middle[None, :] - middle[:, None]
    may_be = (apart > options.apart_hu[0]) & (apart < options.apart_hu[1])
    likely = np.where(may_be, height[:, None] * height[None, :], 0.0)
    fat, muscle = np.unravel_index(int(likely.argmax()), likely.shape)
    if height[fat] < options.least_fat * height[muscle]:
        return 1.0
    wanted = float(np.clip(middle[fat], *options.fat_hu))
    factor = (wanted - AIR_HU) / (float(middle[fat]) - AIR_HU)
    return factor if abs(factor - 1.0) <= options.most else 1.0


def rescaled(hu: NDArray[np.floating], factor: float) -> Float32Array:
    """HU with HU + 1000 multiplied by a factor; exactly as they are where it is 1."""
    if factor == 1.0:
        return np.asarray(hu, dtype=np.float32)
    return np.asarray(AIR_HU + factor * (hu.astype(np.float32) - np.float32(AIR_HU)), dtype=np.float32)
