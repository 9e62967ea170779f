"""Where the sacrum ends and the lumbar spine begins: the disc above the sacrum, a tilted dark layer between bright plates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import FloatArray
from palpate.imaging.labels import BONE_PART_VALUES
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.landmarks import Pelvis
from palpate.segmentation.working_grid import Mask

# The disc is sought by its tilt (degrees forward) and its offset from the upper end of the sacroiliac joints, mm.
TILTS, OFFSETS_MM, USUAL = np.arange(20.0, 61.0, 5.0), np.arange(-8.0, 31.0, 2.0), (40.0, 10.0)
# Half the thickness of the layer, how far the plates lie from its middle, and how much brighter (HU) they are.
LAYER_MM, PLATE_MM, BRIGHTER_HU = 2.0, (6.0, 10.0), 40.0
MIDLINE_MM, FEWEST = 15.0, 100
# Fewer voxels of contact than these, and the scan does not show the sacroiliac joints.
CONTACT = 60


def above_sacrum(hu: Volume, parts: Volume, pelvis: Pelvis) -> Mask:
    """Voxels labelled sacrum that lie above its upper plate; none where the scan ends below the sacroiliac joints."""
    sacrum = parts.array == BONE_PART_VALUES["sacrum"]
    hips = np.isin(parts.array, [BONE_PART_VALUES["hip_left"], BONE_PART_VALUES["hip_right"]])
    joint = parts.to_lps(np.argwhere(sacrum & ndimage.binary_dilation(hips)).astype(float))
    upper = np.zeros(sacrum.shape, dtype=bool)
    if len(joint) < CONTACT:
        return upper
    top = float(np.percentile(joint[:, 2], 90))
    front = float(joint[joint[:, 2] > np.percentile(joint[:, 2], 75), 1].mean())
    index = np.argwhere(sacrum)
    points = parts.to_lps(index.astype(float)) - [0.0, front, top]
    middle = np.abs((points + [0.0, front, top] - pelvis.point) @ pelvis.normal) < MIDLINE_MM
    tilt, offset = _disc(points[middle], hu.array[tuple(index[middle].T)])
    upper[tuple(index[_height(points, tilt) > offset].T)] = True
    return upper


def _disc(points: FloatArray, hu: NDArray[np.floating]) -> tuple[float, float]:
    """Tilt and offset of the layer that is darkest against the plates on both sides of it; the usual where none is."""
    best, most = USUAL, BRIGHTER_HU
    for tilt in TILTS:
        height = _height(points, float(tilt))
        for offset in OFFSETS_MM:
            away = height - offset
            layers = [hu[np.abs(away - at) < LAYER_MM] for at in (0.0, *(s * p for s in (-1.0, 1.0) for p in PLATE_MM))]
            if min(len(layer) for layer in layers) < FEWEST:
                continue
            disc, *plates = (float(layer.mean()) for layer in layers)
            depth = min(max(plates[:2]), max(plates[2:])) - disc
            if depth > most:
                best, most = (float(tilt), float(offset)), depth
    return best


def _height(points: FloatArray, tilt: float) -> FloatArray:
    """Distance (n,) mm above a plane through the origin whose normal leans forward (-y) by ``tilt`` degrees."""
    lean = np.deg2rad(tilt)
    return np.asarray(np.cos(lean) * points[:, 2] - np.sin(lean) * points[:, 1])
