"""Femurs, hip bones and sacrum told apart: on the phantom, whose bones are separate solids, and on the real CTs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from organ_scans import found, truth, truth_of

from palpate.imaging.labels import BONE_PART_VALUES, BONE_PARTS
from palpate.imaging.volume import Volume
from palpate.segmentation.bone.femoral_heads import find_heads
from palpate.segmentation.bone.lumbosacral_disc import above_sacrum
from palpate.segmentation.bone.parts import bone_parts
from palpate.segmentation.pelvis import Segmentation
from palpate.segmentation.search_region import make_scene
from palpate.segmentation.working_grid import mask_on
from palpate.simulate.phantom import anatomy, phantom
from palpate.validate.segmentation.contoured_scan import contoured_scan
from palpate.validate.segmentation.dice import dice

# Order of the phantom's solids.
PUBIS, SACRUM, HIP_LEFT, FEMUR_LEFT, HIP_RIGHT, FEMUR_RIGHT = range(6)


def _solid(*numbers: int) -> np.ndarray:
    """Voxels of the phantom's bone label that lie in some of its solids."""
    bone = truth_of(4).array
    points = truth().to_lps(np.argwhere(bone).astype(float)) - phantom.ORIGIN_MM
    result = np.zeros_like(bone)
    result[bone] = np.any([anatomy.BONES[i].distance(points) < 0.0 for i in numbers], axis=0)
    return result


def test_phantom_bones() -> None:
    parts = found().bones.on(truth(), truth_of(4).array)
    assert dice(parts == BONE_PART_VALUES["femur_left"], _solid(FEMUR_LEFT)) > 0.95
    assert dice(parts == BONE_PART_VALUES["femur_right"], _solid(FEMUR_RIGHT)) > 0.95
    assert dice(parts == BONE_PART_VALUES["sacrum"], _solid(SACRUM)) > 0.97
    hips = np.isin(parts, [BONE_PART_VALUES["hip_left"], BONE_PART_VALUES["hip_right"]])
    assert dice(hips, _solid(PUBIS, HIP_LEFT, HIP_RIGHT)) > 0.95
    left = parts == BONE_PART_VALUES["hip_left"]
    assert (left & _solid(HIP_RIGHT)).sum() == 0
    assert min(found().bones.confidence.values()) > 0.7


def test_phantom_heads() -> None:
    scene = found().scene
    heads = find_heads(scene.whole_hu, scene.pelvis)
    for side, centre in (("left", (89.0, -8.0, 21.0)), ("right", (-86.0, -6.0, 18.0))):
        assert np.linalg.norm(heads[side].centre - phantom.ORIGIN_MM - centre) < 2.5
        assert heads[side].radius_mm == pytest.approx(24.0, abs=1.0)


def test_a_scan_without_heads_has_no_parts() -> None:
    scene = found().scene
    flat = scene.whole_hu.with_array(np.zeros_like(scene.whole_hu.array))
    parts = bone_parts(flat, scene.whole_bone, scene.pelvis)
    assert not parts.labels.array.any()
    assert parts.confidence == {}
    assert not parts.on(truth(), truth_of(4).array).any()


def test_the_disc_above_the_sacrum() -> None:
    """A column of bright blocks with dark discs, leaning: the cut lies in the disc above the iliac joints."""
    grid = Volume(np.zeros((50, 60, 90), dtype=np.uint8), np.diag([2.0, 2.0, 2.0, 1.0]))
    x, y, z = np.moveaxis(np.indices(grid.array.shape) * 2.0, 0, 0)
    lean = np.deg2rad(35.0)
    height = np.cos(lean) * (z - 90.0) - np.sin(lean) * (y - 60.0)
    column = (np.abs(x - 50.0) < 22.0) & (np.abs(y - 60.0) < 24.0)
    labels = np.where(column, BONE_PART_VALUES["sacrum"], 0).astype(np.uint8)
    wing = (np.abs(x - 50.0) >= 22.0) & (np.abs(x - 50.0) < 30.0) & (np.abs(y - 60.0) < 24.0) & (z < 90.0)
    labels[wing] = BONE_PART_VALUES["hip_left"]
    disc = np.abs(np.mod(height - 8.0 + 20.0, 40.0) - 20.0) < 3.5
    hu = np.where(column, np.where(disc, 80.0, 240.0), 0.0)
    straight = found().scene.pelvis
    pelvis = type(straight)(
        np.array([1.0, 0.0, 0.0]), np.array([50.0, 0.0, 0.0]), 1.0, straight.symphysis, straight.sacrum
    )
    upper = above_sacrum(grid.with_array(hu), grid.with_array(labels), pelvis)
    assert np.abs(height[column & (upper != (height > 8.0))] - 8.0).max() < 6.0
    below = grid.with_array(np.where(labels == BONE_PART_VALUES["sacrum"], labels, 0).astype(np.uint8))
    assert not above_sacrum(grid.with_array(hu), below, pelvis).any()


def test_real_femoral_heads_are_femurs(pelvis_small: Path) -> None:
    scan = contoured_scan(pelvis_small / "CT", pelvis_small / "RTstructs.dcm", "scan 1")
    drawn = scan.masks["bone"]
    segmentation = Segmentation(make_scene(scan.ct))
    parts = segmentation.bones.on(drawn, mask_on(segmentation.scene.whole_bone, drawn))
    inside = drawn.array > 0
    x = drawn.to_lps(np.argwhere(inside).astype(float))[:, 0]
    for side, here in (("left", x > x.mean()), ("right", x < x.mean())):
        assert (parts[inside][here] == BONE_PART_VALUES[f"femur_{side}"]).mean() > 0.95
    volumes = {name: segmentation.bones.volume_cc(name) for name in BONE_PARTS.values()}
    assert volumes["femur_left"] == pytest.approx(volumes["femur_right"], rel=0.05)
    assert volumes["hip_left"] == pytest.approx(volumes["hip_right"], rel=0.12)
    assert volumes["spine"] == 0.0
