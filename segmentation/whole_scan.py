"""What a whole CT shows before anything is sought in it: body, bones, landmarks, and the HU of its fat and muscle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.bone import bone_mask
from palpate.segmentation.bone.landmarks import Pelvis, find_pelvis
from palpate.segmentation.hu_scale import rescaled, scale_of
from palpate.segmentation.working_grid import (
    AIR_HU,
    COARSE_MM,
    Mask,
    blurred,
    dilated,
    eroded,
    filled,
    largest,
    mask_on,
    shrunk,
)

SKIN_HU = -250.0
# Table tops and their padding are thinner than twice this, and touch the body with less.
OPENING_MM = 7.0
SMALLEST_L = 0.3
BONE_MM = 2.0


def body_mask(ct: Volume) -> Mask:
    """Mask of the body, gas within it included. ct : HU on an even upright grid, about 3 mm.

    Raises InputError when the scan holds no body.
    """
    step = float(ct.spacing[0])
    solid = ct.array > SKIN_HU
    # Beyond the first and last slice the body goes on; beyond the sides of the picture it does not.
    sides = np.pad(solid, ((1, 1), (1, 1), (0, 0)))
    core = largest(eroded(sides, OPENING_MM, step))
    if core.sum() * step**3 < SMALLEST_L * 1e6:
        raise InputError(f"the scan holds no body: nothing larger than {SMALLEST_L} litres is above {SKIN_HU:.0f} HU")
    near = dilated(core, OPENING_MM + step, step)
    return largest(filled((near & sides)[1:-1, 1:-1], within=2))


def without_surroundings(ct: Volume, body: Mask) -> Volume:
    """The CT with everything outside the body set to air."""
    return ct.with_array(np.where(body, ct.array, np.float32(AIR_HU)))


@dataclass(frozen=True, eq=False)
class WholeScan:
    """body : mask on a coarse grid. hu, bone : HU by the scan's own fat and mask of bone on a 2 mm grid. scale : factor that
    `rescaled` takes. fat, muscle : typical HU."""

    body: Volume
    hu: Volume
    bone: Volume
    scale: float
    pelvis: Pelvis
    fat: float
    muscle: float


def whole_scan(ct: Volume) -> WholeScan:
    """Of a CT (HU, any grid). Raises InputError when it holds no body or no pubic bones."""
    coarse = shrunk(ct, COARSE_MM)
    body = coarse.with_array(body_mask(coarse))
    for_bone = shrunk(ct, BONE_MM)
    within = mask_on(body, for_bone)
    scale = scale_of(for_bone.array, within, BONE_MM)
    for_bone = without_surroundings(for_bone.with_array(rescaled(for_bone.array, scale)), within)
    bone = for_bone.with_array(bone_mask(for_bone))
    fat, muscle = _typical(for_bone.array, within)
    return WholeScan(body, for_bone, bone, scale, find_pelvis(bone), fat, muscle)


def _typical(hu: NDArray[np.floating], body: Mask) -> tuple[float, float]:
    """Most frequent HU of fat and of muscle."""
    count, edges = np.histogram(blurred(hu, 2.0, BONE_MM)[body], bins=np.arange(-160.0, 120.0, 4.0))
    middle = 0.5 * (edges[1:] + edges[:-1])
    fat, muscle = (middle < -60.0), (middle > 10.0) & (middle < 90.0)
    return float(middle[fat][count[fat].argmax()]), float(middle[muscle][count[muscle].argmax()])
