"""The small inputs rebuilt from public bug reports, as they were handed out: table in wild_README.md beside the archive."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from drawn_contours import user_labels

from palpate.case.case_folder import CaseFolder
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.rest_only import import_alone
from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import read_labels
from palpate.imaging.contours.user_labels import read_label_volume
from palpate.imaging.dicom.pair_check import check_pair
from palpate.imaging.dicom.series import read_series
from palpate.imaging.surfaces.surface_files import read_closed_surface

ALL = {1: 461, 5: 215, 6: 215}
PROSTATE = {1: 461}
# File, label -> voxels as imported; folder of the scan; structures chosen.
READ: tuple[tuple[str, dict[int, int], str, dict[str, list[str]]], ...] = (
    ("seg_plain_names/s.dcm", ALL, "base/ct", {}),
    ("nrrd_shared/s.seg.nrrd", ALL, "base/ct", {}),
    ("desc_german/l.nii.gz", ALL, "base/ct", {}),
    ("desc_english/l.nii.gz", ALL, "base/ct", {}),
    ("desc_english/l.nii.gz", ALL, "base/ct", {"prostate": ["3"]}),
    ("desc_spaces/l.nii.gz", ALL, "base/ct", {}),
    ("desc_spaces/l.nii.gz", ALL, "base/ct", {"prostate": ["3"]}),
    ("nrrd_old_slicer/s.seg.nrrd", ALL, "base/ct", {}),
    ("rt_double_contour/rs.dcm", PROSTATE, "base/ct", {}),
    ("rt_part_overlap/rs.dcm", {1: 652}, "base/ct", {}),
    ("seg_odd_bits/s.dcm", ALL, "seg_odd_bits/ct", {}),
    ("seg_labelmap/s.dcm", ALL, "base/ct", {}),
    ("seg_labelmap_palette/s.dcm", ALL, "base/ct", {}),
    ("seg_fractional/s.dcm", ALL, "base/ct", {}),
    ("seg_overlap/s.dcm", {1: 461, 5: 442, 6: 215}, "base/ct", {}),
    ("seg_sparse_358/s.dcm", {1: 163}, "base/ct", {}),
    ("seg_every_second/s.dcm", {1: 230}, "base/ct", {}),
    ("nii_float_in_uint8/l.nii.gz", {1: 461, 5: 215}, "base/ct", {}),
    ("rt_nfd_comma/rs.dcm", {1: 461}, "base/ct", {"bladder": ["Zielorgan", " gesamt"]}),
    ("rt_all/rs.dcm", PROSTATE, "base/ct", {}),
    ("rt_keyhole/rs.dcm", {1: 364}, "base/ct", {}),
    ("rt_xor/rs.dcm", {1: 364}, "base/ct", {}),
    ("rt_second/rs.dcm", {1: 395}, "base/ct", {}),
    ("rt_oblique/rs.dcm", PROSTATE, "rt_oblique/ct", {}),
    ("nii_oblique/l.nii.gz", {1: 1929}, "base/ct", {}),
)
REFUSED = (
    ("rt_same_name/rs.dcm", "base/ct", "several structures for prostate: Prostate #1, Prostate #2"),
    ("nofor/rs_of_other_patient.dcm", "nofor/ct", "is of another patient"),
    ("nii_gz_crc/l.nii.gz", "base/ct", "is damaged"),
    ("rt_xor_spelling/rs.dcm", "base/ct", "CLOSED_PLANAR_XOR"),
)
NOTED = (
    ("seg_every_second/s.dcm", "segment Prostata is empty on 3 slices between its first and its last"),
    ("rt_empty_roi/rs.dcm", "structure Prostate has no contours"),
    ("rt_wrong_number/rs.dcm", "9 contours of the structure number 77, which has no name, were left out"),
    ("desc_spaces/l.nii.gz", "give --roi prostate=3"),
)


def imported(
    wild: Path, file: str, scan: str, case: Path, roi: dict[str, list[str]]
) -> tuple[dict[int, int], list[str]]:
    summary = import_alone(wild / scan, case, ImportOptions(labels=(wild / file, None), roi=roi))
    labels = read_labels(case / "rest_user.nii.gz")
    found = {int(v): int((labels.array == v).sum()) for v in np.unique(labels.array) if v}
    return found, summary["notes"]


def test_contours_that_are_read(wild: Path, tmp_path: Path) -> None:
    for number, (file, expected, scan, roi) in enumerate(READ):
        found, _ = imported(wild, file, scan, tmp_path / f"case {number}", roi)
        assert found == expected, (file, roi)


def test_contours_that_are_refused_or_noted(wild: Path, tmp_path: Path) -> None:
    for file, scan, message in REFUSED:
        with pytest.raises(InputError, match=message):
            imported(wild, file, scan, tmp_path / "none", {})
    for number, (file, note) in enumerate(NOTED):
        _, notes = imported(wild, file, "base/ct", tmp_path / f"case {number}", {})
        assert any(note in each for each in notes), file


def test_scans(wild: Path) -> None:
    assert read_series(wild / "pad_unsigned_63536" / "ct")[0].array.max() == 900
    for name in ("ffdl_oblique/ct", "neg_sbs/ct", "pair_intercept_ok/rest", "pair_intercept_ok/deformed"):
        assert read_series(wild / name)[0].array.min() == -1000
    refusals: dict[str, str] = {
        "pair_intercept_lost/rest": "rest: no voxel is air at -1000 HU",
        "pair_intercept_lost/deformed": "deformed: no voxel is air at -1000 HU",
        "two_acq_interleaved/ct": "holds 2 series; choose one with --series",
    }
    for name, message in refusals.items():
        with pytest.raises(InputError, match=message):
            read_series(wild / name)
    assert read_series(wild / "two_acq_interleaved" / "ct", "2")[0].array.shape[2] == 14
    for name in ("uids_removed", "uids_all_alike"):
        notes = check_pair(*(read_series(wild / name / state) for state in ("rest", "deformed")))
        assert "UIDs were removed or made alike" in notes[0]


def test_surfaces(wild: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name in ("stl_indent", "stl_bom2"):
        assert read_closed_surface(wild / name / "a.stl").surface.enclosed_volume == pytest.approx(32645, abs=1)
    for name in ("stl_comma", "stl_cut"):
        with pytest.raises(InputError, match=r"a\.stl") as refused:
            read_closed_surface(wild / name / "a.stl")
        assert "\n" not in str(refused.value)
    told = capfd.readouterr()
    assert told.err == "" and told.out == ""


def test_label_files(wild: Path, tmp_path: Path) -> None:
    assert any("52 voxels" in note for note in read_label_volume(wild / "mesh_two_pieces" / "rest.nii.gz").notes)
    shutil.copy(wild / "desc_corrected" / "l.nii.gz", tmp_path)
    options = ImportOptions(labels=(tmp_path / "l.nii.gz", None))
    said = []
    for names in ("labels_before.txt", "labels_after.txt"):
        shutil.copy(wild / "desc_corrected" / names, tmp_path / "labels.txt")
        import_alone(wild / "base" / "ct", tmp_path / "case", options)
        case = CaseFolder(tmp_path / "case")
        labels = user_labels(case, "rest")
        assert labels is not None
        assert {int(v): int((labels.array == v).sum()) for v in np.unique(labels.array) if v} == ALL
        said.append(case.read_json("user_labels.json")["rest"]["structures"])
    assert said[0]["prostate"] == ["Prostata"] and said[1]["prostate_left"] == ["prostate left"]


def test_every_input_is_among_them(wild: Path) -> None:
    here = Path(__file__).read_text(encoding="utf-8")
    folders = sorted(folder.name for folder in wild.iterdir() if folder.is_dir())
    assert len(folders) > 40 and [name for name in folders if f'"{name}' not in here] == []
