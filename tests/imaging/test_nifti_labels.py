"""Label volumes through NIfTI: places, values, refusals."""

from __future__ import annotations

from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk

from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import read_labels, read_nifti, write_labels, write_nifti
from palpate.imaging.grid import in_lps_order
from palpate.imaging.volume import Volume

# Asymmetric in every way: sizes, spacings, rotation, labels.
ROTATION = np.linalg.qr(np.array([[0.9, 0.2, 0.1], [-0.3, 0.8, 0.1], [0.1, -0.2, 0.95]]))[0]
FLIPS = [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1)]


def labels(flips: tuple[int, int, int] = (1, 1, 1), rotation: np.ndarray | None = None) -> Volume:
    array = np.zeros((7, 5, 4), dtype=np.uint8)
    array[1, 2, 0], array[5:, 4, 3], array[0, 0, 1], array[6, 0, 2] = 1, 2, 4, 6
    affine = np.eye(4)
    affine[:3, :3] = (np.eye(3) if rotation is None else rotation) * np.array([0.9, 1.1, 2.5]) * np.array(flips)
    affine[:3, 3] = [-31.0, 17.5, -403.25]
    return Volume(array, affine)


def places(volume: Volume) -> dict[int, np.ndarray]:
    return {
        int(value): np.sort(volume.to_lps(np.argwhere(volume.array == value)), axis=0)
        for value in np.unique(volume.array)
    }


def assert_same_places(one: Volume, other: Volume) -> None:
    assert set(places(one)) == set(places(other))
    for value, points in places(one).items():
        np.testing.assert_allclose(points, places(other)[value], atol=1e-3)


@pytest.mark.parametrize("flips", FLIPS)
@pytest.mark.parametrize("rotation", [None, ROTATION], ids=["upright", "turned"])
def test_round_trip_keeps_every_voxel_and_agrees_with_simpleitk(
    tmp_path: Path, flips: tuple[int, int, int], rotation: np.ndarray | None
) -> None:
    volume = labels(flips, rotation)
    write_labels(tmp_path / "a.nii.gz", volume)
    again = read_labels(tmp_path / "a.nii.gz")
    np.testing.assert_array_equal(again.array, volume.array)
    np.testing.assert_allclose(again.affine, volume.affine, atol=1e-4)
    assert_same_places(Volume.from_sitk(sitk.ReadImage(str(tmp_path / "a.nii.gz"))), volume)


@pytest.mark.parametrize("flips", FLIPS)
def test_lps_order_moves_no_voxel(flips: tuple[int, int, int]) -> None:
    volume = labels(flips, ROTATION)
    swapped = Volume(np.transpose(volume.array, (2, 0, 1)), volume.affine[:, [2, 0, 1, 3]])
    ordered = in_lps_order(swapped)
    assert_same_places(ordered, volume)
    assert (np.diag(ordered.affine) > 0).all() and np.linalg.det(ordered.affine[:3, :3]) > 0


def test_numbers_follow_their_meaning(tmp_path: Path) -> None:
    volume = labels()
    write_nifti(tmp_path / "a.nii.gz", volume.with_array(volume.array.astype(np.int16) * 10))
    again = read_labels(tmp_path / "a.nii.gz", {10: 1, 20: 2, 40: 4, 60: 6})
    np.testing.assert_array_equal(again.array, volume.array)


def test_images_keep_their_values(tmp_path: Path) -> None:
    values = np.linspace(-1000, 1000, 140).reshape(7, 5, 4).astype(np.float32)
    write_nifti(tmp_path / "a.nii", labels().with_array(values))
    np.testing.assert_array_equal(read_nifti(tmp_path / "a.nii").array, values)


def _written(path: Path, array: np.ndarray, affine: np.ndarray, sform: int = 1, unit: str = "mm") -> None:
    image = nib.Nifti1Image(array, affine)
    image.set_sform(affine, code=sform)
    image.set_qform(affine, code=sform, strip_shears=True)
    image.header.set_xyzt_units(unit)
    nib.save(image, path)


def test_refusals_name_the_file_and_the_remedy(tmp_path: Path) -> None:
    good = labels()
    path = tmp_path / "a.nii.gz"
    sheared = good.affine.copy()
    sheared[0, 2] = 1.0
    cases: list[tuple[np.ndarray, np.ndarray, dict, str]] = [
        (good.array.astype(np.float32) * 0.5, good.affine, {}, "not whole numbers"),
        (good.array * 5, good.affine, {}, "holds the value 10, which is no label"),
        (np.stack([good.array] * 2, axis=-1), good.affine, {}, r"shape \(7, 5, 4, 2\); one 3D volume"),
        (np.zeros_like(good.array), good.affine, {}, "holds no label, only 0"),
        (good.array, sheared, {}, "sheared grid"),
        (good.array, good.affine, {"sform": 0}, "does not say where it lies"),
        (good.array, good.affine, {"unit": "micron"}, r"not in mm \(micron\)"),
    ]
    for array, affine, options, message in cases:
        _written(path, array, affine, **options)
        with pytest.raises(InputError, match=message) as caught:
            read_labels(path)
        assert str(path) in str(caught.value) and "\n" not in str(caught.value)


def test_two_placements_that_disagree_are_refused(tmp_path: Path) -> None:
    image = nib.Nifti1Image(labels().array, labels().affine)
    image.set_sform(labels().affine, code=1)
    image.set_qform(np.diag([-1.0, 1.0, 1.0, 1.0]) @ labels().affine, code=1)
    nib.save(image, tmp_path / "a.nii.gz")
    with pytest.raises(InputError, match=r"two placements \(sform, qform\)"):
        read_labels(tmp_path / "a.nii.gz")


def test_files_that_are_no_nifti_are_refused(tmp_path: Path) -> None:
    write_labels(tmp_path / "a.nii.gz", labels())
    whole = (tmp_path / "a.nii.gz").read_bytes()
    (tmp_path / "cut.nii.gz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.nii.gz").write_text("hello")
    for name in ("cut.nii.gz", "text.nii.gz"):
        with pytest.raises(InputError, match=f"{name} .*(not a readable NIfTI|ends before)"):
            read_labels(tmp_path / name)
    with pytest.raises(InputError, match="is not there"):
        read_labels(tmp_path / "absent.nii.gz")
