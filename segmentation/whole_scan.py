"""What a whole CT shows before anything is sought in it: body, bones, landmarks, and the HU of its fat and muscle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.imaging.volume import Volume
from palpate.segmentation.body import body_mask, without_surroundings
from palpate.segmentation.bone.bone import bone_mask
from palpate.segmentation.bone.landmarks import Pelvis, find_pelvis
from palpate.segmentation.hu_scale import rescaled, scale_of
from palpate.segmentation.working_grid import COARSE_MM, Mask, blurred, mask_on, shrunk

BONE_MM = 2.0


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
