"""The scale of a scan's HU from its own fat, medium told from bone, and the line that six points give of a rectum."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.imaging.volume import Volume
from palpate.segmentation.bone.bone import bone_mask
from palpate.segmentation.bone.medium import medium_mask
from palpate.segmentation.hu_scale import ScaleOptions, rescaled, scale_of
from palpate.segmentation.rectum.guide import guide_of

STEP = 2.0


def _body(fat: float = -100.0, muscle: float = 50.0) -> np.ndarray:
    """Half fat, half muscle, with noise."""
    made = np.full((30, 30, 30), muscle)
    made[:15] = fat
    return (made + np.random.default_rng(1).normal(0.0, 8.0, made.shape)).astype(np.float32)


@pytest.mark.parametrize(("gain", "offset"), [(1.07, 15.0), (1.07, -15.0), (0.93, 15.0), (0.93, -15.0)])
def test_fat_of_a_scan_off_its_scale_is_brought_back(gain: float, offset: float) -> None:
    off = gain * (_body() + 1000.0) - 1000.0 + offset
    inside = np.ones(off.shape, dtype=bool)
    factor = scale_of(off, inside, STEP)
    again = rescaled(off, factor)
    low, high = ScaleOptions().fat_hu
    assert low - 4.0 < np.median(again[:15]) < high + 4.0
    assert abs(np.median(again[15:]) - 50.0) < 15.0 < abs(np.median(off[15:]) - 50.0)


def test_a_scan_on_its_scale_or_without_fat_is_left_as_it_is() -> None:
    inside = np.ones((30, 30, 30), dtype=bool)
    assert scale_of(_body(), inside, STEP) == 1.0
    assert scale_of(_body(muscle=20.0), inside, STEP) == 1.0
    assert scale_of(_body(fat=45.0), inside, STEP) == 1.0
    hu = _body()
    assert np.array_equal(rescaled(hu, 1.0), hu)


def _pelvis(lumen_hu: float) -> tuple[Volume, np.ndarray]:
    """Muscle with noise, a bladder in front, and a sacrum of cortex and rough marrow behind; and the bladder's mask."""
    random = np.random.default_rng(3)
    x, y, z = np.meshgrid(*(STEP * np.arange(n) for n in (60, 70, 40)), indexing="ij")
    hu = np.full(x.shape, 50.0)
    bladder = (x - 60) ** 2 + (y - 40) ** 2 + (z - 40) ** 2 < 22.0**2
    sacrum = (np.abs(x - 60) < 30) & (np.abs(y - 115) < 14)
    hu[bladder] = lumen_hu
    hu[sacrum] = 300.0 + random.normal(0.0, 90.0, sacrum.sum())
    return Volume((hu + random.normal(0.0, 8.0, hu.shape)).astype(np.float32), np.diag([STEP] * 3 + [1.0])), bladder


def test_medium_as_dense_as_bone_is_no_bone_and_bone_is_no_medium() -> None:
    ct, bladder = _pelvis(320.0)
    found = medium_mask(ct.array, ct.array > 110.0, STEP)
    assert (found & bladder).sum() > 0.95 * bladder.sum() and not (found & ~bladder).any()
    bone = bone_mask(ct)
    assert (bone & bladder).sum() < 0.05 * bladder.sum()
    assert bone[30, 57, 20]
    plain, _ = _pelvis(5.0)
    assert not medium_mask(plain.array, plain.array > 110.0, STEP).any()
    assert np.array_equal(bone_mask(plain), bone & ~bladder)


def test_medium_that_touches_bone_and_even_marrow_of_the_hips_are_told_apart() -> None:
    """Where fat is thin a full bladder and the bones beside it are one piece; marrow of the hips may be as even as medium."""
    ct, bladder = _pelvis(320.0)
    x, y, z = np.meshgrid(*(STEP * np.arange(n) for n in (60, 70, 40)), indexing="ij")
    rough = (np.abs(x - 88) < 9) & (np.abs(y - 40) < 12) & (np.abs(z - 40) < 12) & ~bladder
    hips = ((x < 14) | (x > 106)) & (np.abs(y - 40) < 25)
    noise = np.random.default_rng(5).normal(0.0, 1.0, x.shape)
    hu = np.where(rough, 320.0 + 90.0 * noise, np.where(hips, 320.0 + 8.0 * noise, ct.array)).astype(np.float32)
    found = medium_mask(hu, hu > 110.0, STEP)
    assert (found & bladder).sum() > 0.95 * bladder.sum()
    assert not (found & hips).any() and (found & rough).sum() < 0.5 * rough.sum()


def test_the_line_of_six_points_bends_as_a_tube_does() -> None:
    """A tube of radius 18 at its middle about an arc: middle line and radius come back, in whatever order points are."""
    heights = np.arange(0.0, 81.0, 4.0)
    line = np.column_stack([5.0 + 0.0 * heights, 60.0 + 20.0 * (1.0 - (heights / 40.0 - 1.0) ** 2)])
    points = np.array(
        [[5, 60, 0], [5, 60, 80], [5 - 18, 80, 40], [5 + 18, 80, 40], [5, 80 + 18, 40], [5, 60 - 9, 2]], dtype=float
    )
    guide = guide_of(points[np.random.default_rng(2).permutation(6)], heights)
    assert np.abs(guide.centres - line).max() < 4.0
    assert guide.radii.max() == pytest.approx(18.0, abs=3.0)
    assert guide.radii[0, 0] < 11.0 and guide.radii[-1, 0] < 15.0
