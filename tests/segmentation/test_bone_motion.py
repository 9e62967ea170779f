"""Whether bones moved as one: parts moved by known amounts."""

from __future__ import annotations

import numpy as np
import pytest
from organ_scans import found
from scipy import ndimage
from scipy.spatial.transform import Rotation

from palpate.imaging.labels import BONE_PART_VALUES
from palpate.segmentation.bone.motion import bone_motions, motion_notes
from palpate.segmentation.bone.parts import BoneParts

SHIFT, TURN_DEG = np.array([0.0, 3.0, -1.5]), 3.0


def _moved(parts: BoneParts, name: str) -> BoneParts:
    """The parts with one of them turned about its middle and shifted."""
    volume, value = parts.labels, BONE_PART_VALUES[name]
    mask = volume.array == value
    middle = volume.to_lps(np.argwhere(mask).mean(axis=0)[None])[0]
    back = Rotation.from_euler("x", -TURN_DEG, degrees=True)
    points = volume.to_lps(np.indices(mask.shape).reshape(3, -1).T.astype(float))
    index = volume.to_index(back.apply(points - SHIFT - middle) + middle).T
    there = ndimage.map_coordinates(mask.astype(np.float32), index, order=1).reshape(mask.shape) > 0.5
    array = np.where(mask, 0, volume.array)
    array[there] = value
    return BoneParts(volume.with_array(array.astype(np.uint8)), parts.confidence)


def test_bones_that_stay() -> None:
    motions = bone_motions(found().bones, found().bones)
    assert set(motions) == {"femur_left", "femur_right", "hip_left", "hip_right", "sacrum"}
    assert max(motion.moved_mm for motion in motions.values()) < 0.05
    assert motion_notes(motions) == []


def test_a_femur_that_moved_by_itself_is_named() -> None:
    motions = bone_motions(found().bones, _moved(found().bones, "femur_left"))
    assert motions["femur_left"].turn_deg == pytest.approx(TURN_DEG, abs=0.8)
    assert motions["femur_left"].moved_mm > 2.5
    assert motions["femur_left"].residual_mm < 0.6
    assert max(motions[name].moved_mm for name in ("femur_right", "hip_right", "sacrum")) < 0.3
    (note,) = motion_notes(motions)
    assert note.startswith("the left femur lies")
