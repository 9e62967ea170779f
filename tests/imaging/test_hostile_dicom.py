"""Folders that break naive loaders: each gives the right volume or one line that says why not: the table in the tests' output."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydicom
import SimpleITK as sitk

from palpate.core.errors import InputError
from palpate.imaging.dicom.files import DicomFile, read_file
from palpate.imaging.dicom.pixels import read_slices
from palpate.imaging.dicom.series import read_series
from palpate.imaging.dicom.slices import slices_of
from palpate.imaging.volume import Volume

# What each folder must give: "reads" or the reason for the refusal. Folders of MR are read as MR, to try their decoders.
EXPECTED = {
    "DICOMDIR_dangling": "is a file",
    "dicom2nifti/failing/gantrytilting/001": "reads",
    "dicom2nifti/failing/notavolume/001": "all 4 slices lie at one position",
    "dicom2nifti/failing/slicecount/001": "holds 2 slices",
    "dicom2nifti/failing/sliceincrement/001": "a slice is missing",
    "dicom2nifti/failing/sliceincrement/002": "a slice is missing",
    "dicom2nifti/failing/sliceorientation/001": "has another",
    "dicom2nifti/generic/anatomical/001": "reads",
    "dicom2nifti/generic/anatomical/001_implicit": "reads",
    "dicom2nifti/generic/anatomical/002_non_isotropic": "reads",
    "dicom2nifti/generic/compressed/001": "reads",
    "dicom2nifti/generic/compressed_j2k/001": "reads",
    "dicom2nifti/generic/compressed_jpeg/001": "reads",
    "dicom2nifti/generic/compressed_jpegls/001": "reads",
    "dicom2nifti/generic/compressed_rle/001": "reads",
    "dicom2nifti/generic/rgb/001": "is a colour image",
    "dicom2nifti/philips_enhanced/001": "reads",
    "ge_tilt_varspacing": "reads",
    "philips_tilt_head": "a slice is missing",
    "pydicom_ct": "is not DICOM although its name says so",
    "wg04_ct_compressed": "holds 4 series; choose one",
}


def test_every_folder_reads_or_is_refused_in_one_line(hostile_dicom: Path, shown: list[str]) -> None:
    base = next(hostile_dicom.rglob("ge_tilt_varspacing")).parent
    folders = {p.parent for p in base.rglob("*") if p.is_file() and p.parent != base} | {base / "DICOMDIR_dangling"}
    assert {str(f.relative_to(base)) for f in folders} == set(EXPECTED)
    for name, expected in EXPECTED.items():
        outcome = _outcome(base / name)
        shown.append(f"{name:44s} {outcome.replace(str(base) + '/', '')}")
        assert expected in outcome, name
        assert "\n" not in outcome


def _outcome(folder: Path) -> str:
    try:
        volume, facts = read_series(folder, modalities=("CT", "MR"))
    except InputError as error:
        return f"refused: {error}"
    if not facts.regridded:
        _assert_like_simpleitk(volume, folder)
    spacing = " x ".join(f"{s:.2f}" for s in volume.spacing)
    return f"reads: {facts.modality} {volume.array.shape}, {spacing} mm {'; '.join(facts.notes)}"


def _assert_like_simpleitk(volume: Volume, folder: Path) -> None:
    reader = sitk.ImageSeriesReader()
    names = reader.GetGDCMSeriesFileNames(str(folder))
    try:
        other = Volume.from_sitk(sitk.ReadImage(names[0]) if len(names) == 1 else _read(reader, names))
    except RuntimeError:
        return
    if other.array.shape != volume.array.shape:
        return
    # SimpleITK applies the first slice's rescale to all: compare where it is the same for all.
    slopes = {str(pydicom.dcmread(n, stop_before_pixels=True).get("RescaleSlope")) for n in names}
    if len(slopes) == 1:
        np.testing.assert_allclose(volume.array, other.array, atol=0.51)
    corners = np.array([[0, 0, 0], np.array(volume.array.shape) - 1.0])
    np.testing.assert_allclose(volume.to_lps(corners), other.to_lps(corners), atol=0.02)


def _read(reader: sitk.ImageSeriesReader, names: tuple[str, ...]) -> sitk.Image:
    reader.SetFileNames(names)
    return reader.Execute()


def test_every_transfer_syntax_decodes_to_what_simpleitk_decodes(hostile_dicom: Path) -> None:
    seen = set()
    for path in sorted(
        p for folder in ("wg04_ct_compressed", "pydicom_ct") for p in hostile_dicom.rglob(f"{folder}/*")
    ):
        header = read_file(path, stop_before_pixels=True)
        if header is None or header.get("Modality") != "CT" or "ImagePositionPatient" not in header:
            continue
        pixels = read_slices(slices_of(DicomFile(path, header)))
        other = sitk.GetArrayFromImage(sitk.ReadImage(str(path)))
        # Lossy JPEG 2000 may be rounded by one between decoders.
        np.testing.assert_allclose(pixels, other, atol=1.01, err_msg=path.name)
        seen.add(header.file_meta.TransferSyntaxUID.name)
    assert len(seen) >= 7, seen


def test_compressed_twins_are_equal(hostile_dicom: Path) -> None:
    """One scan in four transfer syntaxes."""
    generic = next(hostile_dicom.rglob("generic"))
    plain, _ = read_series(generic / "compressed_rle" / "001", modalities=("MR",))
    for twin in ("compressed_jpegls/001", "compressed_jpeg/001", "compressed_j2k/001"):
        volume, _ = read_series(generic / twin, modalities=("MR",))
        np.testing.assert_array_equal(volume.array, plain.array, err_msg=twin)
        np.testing.assert_allclose(volume.affine, plain.affine)


def test_tilted_slices_keep_their_pixels_at_their_place(hostile_dicom: Path) -> None:
    """Every voxel of a tilted series comes back at the patient coordinates that its file states."""
    folder = next(hostile_dicom.rglob("gantrytilting")) / "001"
    volume, facts = read_series(folder)
    difference = []
    for path in facts.files:
        dataset = pydicom.dcmread(path)
        right, down = np.array(dataset.ImageOrientationPatient, dtype=float).reshape(2, 3)
        j, i = np.mgrid[100:400:17, 100:400:17]
        step = np.array(dataset.PixelSpacing, dtype=float)
        origin = np.array(dataset.ImagePositionPatient, dtype=float)
        places = origin + i[..., None] * step[1] * right + j[..., None] * step[0] * down
        index = volume.to_index(places.reshape(-1, 3))
        assert np.abs(index[:, 2] - np.rint(index[:, 2])).max() < 1e-3
        shown = dataset.pixel_array[j, i] * float(dataset.RescaleSlope) + float(dataset.RescaleIntercept)
        low = np.floor(index[:, 1]).astype(int)
        share = index[:, 1] - low
        columns, k = np.rint(index[:, 0]).astype(int), np.rint(index[:, 2]).astype(int)
        # Between two voxels of the right-angled grid that were interpolated from the slice: a bound by its neighbours.
        found = (1 - share) * volume.array[columns, low, k] + share * volume.array[columns, low + 1, k]
        difference.append(found - shown.ravel())
    assert abs(np.mean(difference)) < 0.5


def test_real_pelvis_agrees_with_simpleitk(pelvis_small: Path) -> None:
    volume, facts = read_series(pelvis_small / "CT")
    assert facts.notes == () and not facts.regridded
    reader = sitk.ImageSeriesReader()
    other = Volume.from_sitk(_read(reader, reader.GetGDCMSeriesFileNames(str(pelvis_small / "CT"), facts.series_uid)))
    np.testing.assert_array_equal(volume.array, other.array)
    np.testing.assert_allclose(volume.affine, other.affine, atol=1e-4)
