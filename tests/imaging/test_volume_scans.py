"""A CT in a volume file is the CT that it was written from: place, units, direction and HU, or a refusal in one line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk
from contour_files import outlines, rtstruct
from contour_files import scan as dicom_scan
from scipy.spatial.transform import Rotation

from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import RAS_TO_LPS, write_nifti
from palpate.imaging.contours.user_labels import read_user_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.scans.scan import is_ct, read_scan
from palpate.imaging.volume import Volume

FORMS = ("a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.mhd")
OBLIQUE = Rotation.from_euler("xyz", (6.0, -9.0, 14.0), degrees=True).as_matrix()


def body(direction: np.ndarray | None = None) -> Volume:
    """A body of fat around muscle with one dense spot to the left, in front and above, in air. No symmetry."""
    array = np.full((14, 12, 10), -1000, dtype=np.int16)
    array[2:12, 2:10, :] = -100
    array[3:11, 3:9, :] = 50
    array[9, 4, 7] = 900
    affine = np.eye(4)
    affine[:3, :3] = (np.eye(3) if direction is None else direction) * np.array([2.0, 3.0, 4.0])
    affine[:3, 3] = [-11.0, 17.5, 203.25]
    return Volume(array, affine)


def write(path: Path, volume: Volume) -> Path:
    if path.name.endswith((".nii", ".nii.gz")):
        write_nifti(path, volume)
    else:
        sitk.WriteImage(volume.to_sitk(), str(path), useCompression=path.suffix != ".mhd")
    return path


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    "direction", [np.eye(3), np.diag([-1.0, -1.0, 1.0]), np.eye(3)[:, [2, 0, 1]], np.diag([1.0, 1.0, -1.0]), OBLIQUE],
    ids=["LPS", "RAS", "turned", "left-handed", "oblique"],
)  # fmt: skip
def test_every_voxel_stays_where_it_is(form: str, direction: np.ndarray, tmp_path: Path) -> None:
    truth = in_lps_order(body(direction))
    volume, facts = read_scan(write(tmp_path / form, body(direction)))
    np.testing.assert_array_equal(volume.array, truth.array)
    np.testing.assert_allclose(volume.affine, truth.affine, atol=1e-5)
    assert volume.array.dtype == np.int16 and np.linalg.det(volume.affine[:3, :3]) > 0
    assert facts.patient_hash is None and not facts.is_dicom and "it is no DICOM" in facts.notes[-1]


@pytest.mark.parametrize(
    ("space", "signs"), [("right-anterior-superior", (-1, -1, 1)), ("left-anterior-superior", (1, -1, 1))]
)
def test_the_space_of_a_nrrd_is_heard(space: str, signs: tuple[int, int, int], tmp_path: Path) -> None:
    path = write(tmp_path / "a.nrrd", body())
    path.write_bytes(path.read_bytes().replace(b"left-posterior-superior", space.encode(), 1))
    truth = in_lps_order(body().moved(np.diag([*signs, 1.0])))
    np.testing.assert_allclose(read_scan(path)[0].affine, truth.affine)
    np.testing.assert_array_equal(read_scan(path)[0].array, truth.array)


def test_centimetres_are_scaled_and_told(tmp_path: Path) -> None:
    path = write(tmp_path / "a.nrrd", body())
    header = b'encoding: gzip\nspace units: "cm" "cm" "cm"\n'
    path.write_bytes(path.read_bytes().replace(b"encoding: gzip\n", header, 1))
    volume, facts = read_scan(path)
    np.testing.assert_allclose(volume.affine[:3], 10.0 * body().affine[:3])
    assert "a.nrrd states its place in units of 10 mm and was scaled to mm" in facts.notes


def test_nifti_in_metres_is_refused_and_its_slope_is_heard(tmp_path: Path) -> None:
    path = write(tmp_path / "a.nii", body())
    image = nib.load(path)
    image.header.set_xyzt_units("meter")
    nib.save(image, tmp_path / "m.nii")
    with pytest.raises(InputError, match=r"m\.nii is not in mm \(meter\)"):
        read_scan(tmp_path / "m.nii")
    stored = nib.Nifti1Image((body().array + 1024).astype(np.uint16), RAS_TO_LPS @ body().affine)
    stored.set_sform(stored.affine, code=1)
    stored.header.set_slope_inter(1.0, -1024.0)
    nib.save(stored, tmp_path / "s.nii")
    np.testing.assert_array_equal(read_scan(tmp_path / "s.nii")[0].array, in_lps_order(body()).array)


@pytest.mark.parametrize(
    "change",
    [lambda a: a + 1024, lambda a: (a + 1000) / 1900.0, lambda a: np.clip(a, -160, 240) + 160, lambda a: a * 0.1,
     lambda a: np.abs(a - 50) * 2.0, lambda a: a + 200, lambda a: np.where(a > 500, 32767, a)],
    ids=["without intercept", "normalised", "windowed", "slope", "MR", "shifted", "saturated"],
)  # fmt: skip
@pytest.mark.parametrize("form", ["a.nii.gz", "a.mha"])
def test_what_is_not_in_hu_is_refused(form: str, change: Callable, tmp_path: Path) -> None:
    path = write(tmp_path / form, body().with_array(change(body().array.astype(np.float32))))
    with pytest.raises(InputError, match=rf"{form}: .*(no Hounsfield units|no HU)") as caught:
        read_scan(path)
    assert "\n" not in str(caught.value)


def test_a_scan_cut_to_the_body_is_taken_by_its_fat(tmp_path: Path) -> None:
    inner = body().array[2:12, 2:10]
    volume, _ = read_scan(write(tmp_path / "a.nrrd", body().with_array(inner)))
    assert volume.array.shape == inner.shape


def test_nothing_around_a_round_field_of_view_is_air(tmp_path: Path) -> None:
    """Cone-beam scans say 0 HU there, which is water."""
    y, x = np.mgrid[:60, :50]
    around, organ = np.hypot(y - 29.5, x - 24.5) > 23.0, np.hypot(y - 29.5, x - 24.5) < 15.0
    array = np.repeat(np.where(around, 0, np.where(organ, 50, -1000))[..., None], 6, axis=2).astype(np.int16)
    array[20:40, 20:22], array[25:30, 25:30] = -100, 0
    volume, facts = read_scan(write(tmp_path / "a.nrrd", body().with_array(array)))
    assert (volume.array[around] == -1000).all() and (volume.array[25:30, 25:30] == 0).all()
    assert any("padding outside the field of view" in note for note in facts.notes)


def test_labels_are_told_from_a_ct(tmp_path: Path) -> None:
    labels = body().with_array((body().array > 0).astype(np.uint8) * 5)
    assert is_ct(write(tmp_path / "ct.nii.gz", body())) and is_ct(tmp_path)
    assert not is_ct(write(tmp_path / "labels.nii.gz", labels))
    for name in ("a.seg.nrrd", "a.txt"):
        (tmp_path / name).write_text("x")
        with pytest.raises(InputError, match=rf"{name} is no scan; give a folder with a DICOM CT"):
            is_ct(tmp_path / name)


@pytest.mark.parametrize("form", ["a.nrrd", "a.mha", "a.mhd"])
def test_damage_is_told_in_one_line_and_by_nobody_else(form: str, tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """MetaIO reads a damaged compressed file as if it were whole, and complains of others on standard error."""
    path = write(tmp_path / form, body())
    voxels = path.with_suffix(".raw") if form == "a.mhd" else path
    whole = voxels.read_bytes()
    bad = [whole[:-40], b"rubbish" * 9] if form != "a.mhd" else [whole[:-40]]
    bad += [bytes([*whole[:-30], whole[-30] ^ 4, *whole[-29:]])] if form != "a.mhd" else []
    for content in bad:
        voxels.write_bytes(content)
        with pytest.raises(InputError, match=r"a\.\w+ (is damaged|ends before|is not a readable)"):
            read_scan(path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("named", ["absent.raw", "../a.raw", "LIST", "/etc/hostname", ""])
def test_voxels_elsewhere_are_not_read(named: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.mhd", body())
    path.write_text(path.read_text().replace("a.raw", named))
    with pytest.raises(InputError, match=r"a\.mhd (names no file beside it|is not a readable)"):
        read_scan(path)


@pytest.mark.parametrize("gone", ["TransformMatrix", "Offset"])
def test_a_metaimage_without_a_place_is_refused(gone: str, tmp_path: Path) -> None:
    path = write(tmp_path / "a.mhd", body())
    path.write_text("".join(line for line in path.read_text().splitlines(True) if not line.startswith(gone)))
    with pytest.raises(InputError, match=r"a\.mhd does not say where it lies in the patient"):
        read_scan(path)


def test_a_sheared_grid_and_another_modality_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.nrrd", body())
    path.write_bytes(path.read_bytes().replace(b"(2,0,0) (0,3,0)", b"(2,1,0) (0,3,0)", 1))
    with pytest.raises(InputError, match=r"a\.nrrd (has a sheared|is not a readable)"):
        read_scan(path)
    meta = write(tmp_path / "a.mhd", body())
    meta.write_text(meta.read_text().replace("NDims = 3", "NDims = 3\nModality = MET_MOD_MR"))
    with pytest.raises(InputError, match="is no CT: its Modality is MET_MOD_MR"):
        read_scan(meta)


def test_contours_on_a_volume_file_are_taken_with_a_note(tmp_path: Path) -> None:
    """A structure set names images that the file no longer names: the same voxels as on the DICOM series."""
    _, volume, facts = dicom_scan(tmp_path / "ct")
    path, _ = rtstruct(tmp_path / "rs.dcm", {"Prostate": outlines("prostate")})
    hu = np.where(np.indices(volume.array.shape)[0] < 6, -1000, np.where(volume.array > 200, 50, -100))
    file = write(tmp_path / "a.nrrd", volume.with_array(hu.astype(np.int16)))
    found = read_user_labels(path, *read_scan(file))
    np.testing.assert_array_equal(found.volume.array, read_user_labels(path, volume, facts).volume.array)
    assert "the scan is no DICOM: that this was drawn on it was not checked" in found.notes
