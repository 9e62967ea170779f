"""Alignment on bone against known rigid motions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk
from bone_scans import bone_labels, largest_error, moving, scan

from palpate.core.errors import InputError
from palpate.imaging.dicom.series import read_series
from palpate.imaging.registration.align_on_bone import Alignment, _accepted, align_ct, align_labels
from palpate.imaging.volume import Volume


def test_one_position_stays() -> None:
    found = align_ct(scan(), scan(noise=16.0))
    assert largest_error(found.deformed_to_rest, np.eye(4)) < 0.05
    assert found.residual_mm < 0.3 and found.notes == () and found.overlap > 0.97


@pytest.mark.parametrize(
    ("angles", "shift"), [((3.0, -2.0, 4.0), (6.0, -9.0, 8.0)), ((-5.0, 4.0, -6.0), (-14.0, 12.0, -10.0))]
)
def test_a_known_motion_is_found(angles: tuple[float, float, float], shift: tuple[float, float, float]) -> None:
    truth = moving(angles, shift)
    found = align_ct(scan(), scan(truth))
    assert largest_error(found.deformed_to_rest, truth) < 0.2
    assert found.residual_mm < 0.4 and found.notes == ()


def test_a_shorter_scan_is_found_in_the_longer() -> None:
    truth = moving((2.0, 1.0, -2.0), (3.0, 4.0, -5.0))
    found = align_ct(scan(), scan(truth, lowest=-12.0))
    assert largest_error(found.deformed_to_rest, truth) < 0.4


def test_the_answer_is_the_same_every_time() -> None:
    pair = scan(), scan(moving((2.0, -1.0, 3.0), (4.0, 2.0, -6.0)))
    np.testing.assert_array_equal(align_ct(*pair).deformed_to_rest, align_ct(*pair).deformed_to_rest)


@pytest.mark.parametrize("leg_shift", [3.0, 6.0, 25.0])
def test_a_leg_that_moved_by_itself_is_left_out_and_named(leg_shift: float) -> None:
    truth = moving((1.0, 2.0, -1.0), (3.0, -2.0, 4.0))
    found = align_ct(scan(), scan(truth, leg_shift=leg_shift))
    assert largest_error(found.deformed_to_rest, truth) < 0.6
    assert "bones on the left did not move with the others" in found.notes[0] and len(found.notes) == 1
    assert found.part_residual_mm["centre"] < 0.4


def test_label_volumes_are_aligned_on_their_bone() -> None:
    truth = moving((2.0, -3.0, 2.0), (4.0, -3.0, 5.0))
    found = align_labels(bone_labels(scan()), bone_labels(scan(truth)))
    assert largest_error(found.deformed_to_rest, truth) < 0.3


def test_scans_without_common_bone_are_refused() -> None:
    soft = scan()
    with pytest.raises(InputError, match="the deformed scan shows no bone above 200 HU"):
        align_ct(soft, soft.with_array(np.minimum(soft.array, 100)))
    with pytest.raises(InputError, match=r"has no bone \(label 4\)"):
        align_labels(soft.with_array(np.ones(soft.array.shape, dtype=np.uint8)), bone_labels(soft))
    other = scan()
    random = np.random.default_rng(0).random(other.array.shape)
    smooth = sitk.GetArrayFromImage(sitk.SmoothingRecursiveGaussian(sitk.GetImageFromArray(random), 4.0))
    other = other.with_array(np.where(smooth > np.percentile(smooth, 80), 700, 40).astype(np.int16))
    with pytest.raises(InputError, match=r"give two scans of (one patient|the same region)"):
        align_ct(scan(), other)


@pytest.mark.nightly
@pytest.mark.parametrize(("radius_mm", "gain", "shift"), [(90.0, 1.0, -250.0), (120.0, 0.8, 0.0)])
def test_bones_that_lie_apart_because_the_hu_are_off_are_not_told_as_a_bad_alignment(
    radius_mm: float, gain: float, shift: float
) -> None:
    """As a cone-beam scanner shows the sample pair's deformed scan; a scan that is not aligned well is told of still."""
    sample = Path(__file__).parents[2] / "sample_dicom"
    rest, deformed = (read_series(sample / state)[0] for state in ("rest", "deformed"))
    values = np.where(deformed.array > -900, (deformed.array + 1000.0) * gain - 1000.0 + shift, deformed.array)
    across = deformed.to_lps(np.argwhere(np.ones(deformed.array.shape[:2])) @ np.eye(2, 3))
    outside = np.linalg.norm((across - across.mean(axis=0))[:, :2], axis=1) > radius_mm
    values[outside.reshape(values.shape[:2])] = -1000.0
    found = align_ct(rest, deformed.with_array(np.rint(values).astype(np.int16)))
    assert found.part_residual_mm["centre"] > 1.5 and found.notes == ()
    told = _accepted(found, hu_off=False).notes
    assert any("the bones agree to" in note for note in told)
    assert largest_error(found.deformed_to_rest, align_ct(rest, deformed).deformed_to_rest) < 0.6


def test_bones_far_apart_are_refused_with_the_hu_as_the_reason_where_they_are_off() -> None:
    apart = Alignment(np.eye(4), 3.0, {"centre": 3.0}, 0.0, 1.0)
    with pytest.raises(InputError, match="give two scans of one patient"):
        _accepted(apart, hu_off=False)
    with pytest.raises(InputError, match="the HU of a scan, by which bone is found, are off: calibrate it"):
        _accepted(apart, hu_off=True)
    assert _accepted(replace(apart, part_residual_mm={"centre": 2.0}), hu_off=True).notes == ()


def test_a_real_pelvis_moved_by_a_known_motion(pelvis_small: Path) -> None:
    whole, _ = read_series(pelvis_small / "CT")
    ct = Volume(whole.array[::2, ::2], whole.affine @ np.diag([2.0, 2.0, 1.0, 1.0]))
    centre = ct.to_lps(np.array(ct.array.shape)[None] / 2)[0]
    truth = moving((2.0, -3.0, 4.0), (0.0, 0.0, 0.0))
    truth[:3, 3] = centre - truth[:3, :3] @ centre + [5.0, -7.0, 9.0]
    transform = sitk.AffineTransform(3)
    transform.SetMatrix(truth[:3, :3].ravel().tolist())
    transform.SetTranslation(truth[:3, 3].tolist())
    image = sitk.Cast(ct.to_sitk(), sitk.sitkFloat32)
    moved = Volume.from_sitk(sitk.Resample(image, image, transform, sitk.sitkLinear, -1000.0))
    found = align_ct(ct, moved.with_array(moved.array + np.random.default_rng(1).normal(0, 20, moved.array.shape)))
    bone = ct.to_lps(np.argwhere(ct.array > 200)[::50].astype(float))
    apart = (bone @ (found.deformed_to_rest - truth)[:3, :3].T) + (found.deformed_to_rest - truth)[:3, 3]
    assert np.linalg.norm(apart, axis=1).max() < 0.3
    assert found.notes == ()
