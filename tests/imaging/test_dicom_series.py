"""DICOM series against the field they were sampled from, and the refusals."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk
from dicom_samples import PATIENT_ID, PATIENT_NAME, ct_slice, enhanced_ct, hounsfield, save, series, straight
from pydicom.uid import ImplicitVRLittleEndian

from palpate.core.errors import InputError
from palpate.imaging.dicom.series import read_series
from palpate.imaging.volume import Volume


def assert_shows_the_field(volume: Volume, tolerance: float = 1.0, inset: int = 0) -> None:
    """Every voxel holds what the field is at the voxel's place in the patient."""
    index = np.argwhere(np.ones(volume.array.shape, dtype=bool))
    keep = np.all((index >= inset) & (index < np.array(volume.array.shape) - inset), axis=1)
    difference = volume.array[tuple(index[keep].T)] - hounsfield(volume.to_lps(index[keep]))
    assert np.abs(difference).max() <= tolerance


@pytest.mark.parametrize(
    "orientation",
    [
        (1, 0, 0, 0, 1, 0),
        (-1, 0, 0, 0, -1, 0),
        (-1, 0, 0, 0, 1, 0),
        (1, 0, 0, 0, -1, 0),
        (0, 1, 0, 0, 0, -1),
        (0.96, 0.28, 0, -0.28, 0.96, 0),
    ],
    ids=["HFS", "HFP", "FFS", "upside down", "sagittal", "oblique"],
)
def test_every_orientation_puts_the_field_where_it_was(tmp_path: Path, orientation: tuple[float, ...]) -> None:
    normal = np.cross(orientation[:3], orientation[3:])
    origins = [tuple(np.array([-11.0, -7.0, 5.0]) - 2.5 * k * normal) for k in range(5)]
    volume, facts = read_series(save(tmp_path / "ct", series(origins, orientation=orientation)))
    assert volume.array.dtype == np.int16
    assert_shows_the_field(volume, 0.51)
    np.testing.assert_allclose(volume.spacing, [1.5, 2.0, 2.5])
    assert np.linalg.det(volume.affine[:3, :3]) > 0
    assert not facts.regridded and facts.notes == ()


def test_agrees_with_simpleitk(tmp_path: Path) -> None:
    folder = save(tmp_path / "ct", series(straight()))
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    other = Volume.from_sitk(reader.Execute())
    volume, _ = read_series(folder)
    np.testing.assert_array_equal(volume.array, other.array)
    np.testing.assert_allclose(volume.affine, other.affine, atol=1e-6)


def test_facts_are_in_slice_order_and_without_identity(tmp_path: Path) -> None:
    slices = series(straight())
    _, facts = read_series(save(tmp_path / "ct", slices))
    assert facts.sop_uids == tuple(s.SOPInstanceUID for s in slices)
    assert len(facts.files) == 6 and facts.modality == "CT" and facts.patient_position == "HFS"
    for secret in (PATIENT_NAME, PATIENT_ID, "19500101"):
        assert secret not in repr(facts)


def test_tilted_gantry_is_straightened(tmp_path: Path) -> None:
    tilt = math.radians(18.0)
    orientation = (1.0, 0.0, 0.0, 0.0, math.cos(tilt), -math.sin(tilt))
    folder = save(tmp_path / "ct", series(straight(9), orientation=orientation))
    volume, facts = read_series(folder)
    assert facts.regridded and "18.0 degrees" in facts.notes[0]
    columns = volume.affine[:3, :3] / volume.spacing
    np.testing.assert_allclose(columns.T @ columns, np.eye(3), atol=1e-9)
    # Where the field was sampled it is there again; the rest of the grid is air (the lowest value).
    middle = volume.to_index(np.array([[3.0, 14.0, 14.0], [8.0, 20.0, 10.0], [-4.0, 10.0, 18.0]]))
    for index in np.rint(middle).astype(int):
        expected = hounsfield(volume.to_lps(index[None].astype(float)))[0]
        assert abs(float(volume.array[tuple(index)]) - expected) < 1.6


def test_uneven_gaps_are_interpolated_and_noted(tmp_path: Path) -> None:
    heights = np.cumsum([0.0, 2, 2, 2, 2, 3, 3, 3, 3])
    volume, facts = read_series(save(tmp_path / "ct", series([(-11.0, -7.0, z) for z in heights])))
    assert facts.regridded and "2.00 to 3.00 mm apart" in facts.notes[0]
    assert_shows_the_field(volume, 1.6)


def test_rounded_positions_count_as_even(tmp_path: Path) -> None:
    origins = [(-11.0, -7.0, round(0.625 * k, 1)) for k in range(12)]
    volume, facts = read_series(save(tmp_path / "ct", series(origins)))
    assert not facts.regridded
    assert volume.spacing[2] == pytest.approx(0.625, abs=0.01)


def test_rescale_differs_from_slice_to_slice(tmp_path: Path) -> None:
    slices = [ct_slice(o, n, slope=0.5 + 0.25 * n, intercept=-1000.0 - n) for n, o in enumerate(straight(), start=1)]
    volume, _ = read_series(save(tmp_path / "ct", slices))
    assert volume.array.dtype == np.float32
    assert_shows_the_field(volume, 1.1)


def test_enhanced_multi_frame(tmp_path: Path) -> None:
    positions = straight(6)[::-1]
    volume, facts = read_series(save(tmp_path / "ct", [enhanced_ct(positions)]))
    assert_shows_the_field(volume, 0.51)
    assert facts.frames == (5, 4, 3, 2, 1, 0) and len(facts.files) == 1


def test_implicit_vr_and_a_file_without_preamble(tmp_path: Path) -> None:
    slices = series(straight())
    folder = save(tmp_path / "ct", slices[:5])
    last = slices[5]
    last.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian
    last.save_as(folder / "bare", implicit_vr=True, little_endian=True, enforce_file_format=False)
    (folder / "bare").write_bytes((folder / "bare").read_bytes()[132:])
    volume, _ = read_series(folder)
    assert volume.array.shape[2] == 6
    assert_shows_the_field(volume, 0.51)


def test_copies_scouts_and_other_files_are_left_out_with_a_note(tmp_path: Path) -> None:
    slices = series(straight())
    folder = save(tmp_path / "ct", slices)
    save(folder / "again", slices[:2])
    scout = ct_slice((0.0, 0.0, 0.0), 1, orientation=(0, 1, 0, 0, 0, -1))
    scout.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
    scout.save_as(folder / "scout", enforce_file_format=True)
    (folder / "readme.txt").write_text("not an image")
    volume, facts = read_series(folder)
    assert volume.array.shape[2] == 6
    assert [note.split(",")[0] for note in facts.notes] == [
        "1 files that are not DICOM were left out",
        "1 scout images were left out",
        "2 slices were there twice and are used once",
    ]


def test_two_series_are_listed_and_chosen(tmp_path: Path) -> None:
    folder = save(tmp_path / "ct", series(straight()))
    save(folder / "b", series(straight(4), series="1.2.3.77"))
    with pytest.raises(InputError, match=r"holds 2 series; choose one with --series .*: 1 .*6 files.* 2 .*4 files"):
        read_series(folder)
    for choice, count in (("1", 6), ("2", 4), ("1.2.3.7", 4), (".77", 4)):
        assert read_series(folder, choice)[0].array.shape[2] == count
    with pytest.raises(InputError, match="--series 9 names no series"):
        read_series(folder, "9")


def _without(index: int) -> list:
    slices = series(straight(8))
    del slices[index]
    return slices


def _changed(**elements: object) -> list:
    slices = series(straight())
    for keyword, value in elements.items():
        setattr(slices[2], keyword, value)
    return slices


def _all_changed(**elements: object) -> list:
    slices = series(straight())
    for one in slices:
        for keyword, value in elements.items():
            setattr(one, keyword, value)
    return slices


def _lacking(keyword: str) -> list:
    slices = series(straight())
    delattr(slices[2], keyword)
    return slices


def _other_picture() -> list:
    return [*series(straight()), ct_slice(straight()[2], 9, values=lambda p: hounsfield(p) + 5.0)]


REFUSED = {
    "missing slice": (
        lambda: _without(3),
        r"a slice is missing between .*im_\d+.dcm and im_\d+.dcm: 6.00 mm apart .* copy",
    ),
    "missing in a coarser part": (lambda: series([(0, 0, z) for z in (0, 2, 4, 8, 10, 12)]), "a slice is missing"),
    "wide gap": (lambda: series([(0, 0, z) for z in np.cumsum([0, 2, 2, 2, 2, 2, 5, 5, 5])]), "up to 2.05 times"),
    "one position": (lambda: series([straight()[0]] * 4), "all 4 slices lie at one position"),
    "too few": (lambda: series(straight(2)), "holds 2 slices; at least 3 are needed"),
    "two pictures of one place": (_other_picture, "two different images at position 11.0 mm"),
    "another size": (lambda: _changed(Rows=12), r"is 20 x 12 pixels but .* is 20 x 24"),
    "another orientation": (lambda: _changed(ImageOrientationPatient=[1, 0, 0, 0, 0.8, 0.6]), "another orientation"),
    "another spacing": (lambda: _changed(PixelSpacing=[2.0, 1.6]), "another PixelSpacing"),
    "aside": (lambda: _changed(ImagePositionPatient=[-3.0, -7.0, 11.0]), "lies 8.0 mm aside of the line"),
    "colour": (lambda: _changed(SamplesPerPixel=3), "is a colour image"),
    "no rescale": (lambda: _lacking("RescaleIntercept"), "lacks RescaleIntercept"),
    "not HU": (lambda: _changed(RescaleType="Z_EFF"), "holds Z_EFF values, not HU"),
    "no orientation": (lambda: _lacking("ImageOrientationPatient"), "lacks ImageOrientationPatient"),
    "skewed orientation": (lambda: _changed(ImageOrientationPatient=[1, 0, 0, 0.5, 0.8, 0]), "no pair of unit vectors"),
    "two frames of reference": (lambda: _changed(FrameOfReferenceUID="1.9"), "2 frames of reference"),
    "cut pixels": (lambda: _changed(PixelData=b"\0\0\0\0"), "pixels that cannot be decoded .* copy or export it again"),
    "no CT": (lambda: _all_changed(Modality="MR"), "no CT image series, only 6 MR"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_one_line_that_names_the_place_but_no_patient(tmp_path: Path, case: str) -> None:
    make, message = REFUSED[case]
    folder = save(tmp_path / "ct", make())
    with pytest.raises(InputError, match=message) as caught:
        read_series(folder)
    text = str(caught.value)
    assert "\n" not in text and str(tmp_path) in text
    assert PATIENT_ID not in text and "Rossi" not in text


def test_wrong_paths_are_refused(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("hello")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "notes.txt").write_text("hello")
    damaged = save(tmp_path / "damaged", series(straight()))
    (damaged / "im_001.dcm").write_bytes(b"")
    for name, message in {
        "absent": "is not there",
        "empty": "is empty; give the folder",
        "text.txt": "is a file; give the folder",
        "other": "holds no DICOM image",
        "damaged": r"im_001.dcm is not DICOM although its name says so",
    }.items():
        with pytest.raises(InputError, match=message):
            read_series(tmp_path / name)
