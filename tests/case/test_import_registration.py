"""A DICOM registration between the two scans: its direction, its frames of reference, and what it must not be."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pydicom
import pytest
from bone_scans import moving, scan
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.uid import (
    DeformableSpatialRegistrationStorage,
    ExplicitVRLittleEndian,
    SpatialRegistrationStorage,
    generate_uid,
)

import palpate
from palpate.case.case_folder import CaseFolder
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.series import SeriesFacts, read_series
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.registration.dicom_registration import read_registration
from palpate.ui import export
from palpate.ui.cli.commands.import_scans import text_of

# What the bones say: points of the deformed scan into the frame at rest.
TRUTH = moving((2.0, -1.0, 3.0), (4.0, 2.0, -6.0))
BACK = np.linalg.inv(TRUTH)
Item = tuple[str | None, FloatArray | None, list[str]]


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, SeriesFacts, SeriesFacts]]:
    folder = tmp_path_factory.mktemp("pair")
    for word, volume in (("rest", scan()), ("deformed", scan(TRUTH))):
        who = SeriesIdentity("P1", "Rossi^Mario", "study", word, word, 1, "study", word, "made for a test")
        write_ct_series(folder / word, volume, who, compress=False)
    yield folder, read_series(folder / "rest")[1], read_series(folder / "deformed")[1]


def reg(path: Path, own: str, items: list[Item], kind: str = "RIGID") -> Path:
    """A registration as planning systems write it. own : its frame. items : frame, matrix into ``own``, images."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.TransferSyntaxUID = SpatialRegistrationStorage, ExplicitVRLittleEndian
    meta.MediaStorageSOPInstanceUID = generate_uid()
    data = FileDataset("", {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.SOPInstanceUID, data.Modality = SpatialRegistrationStorage, generate_uid(), "REG"
    data.FrameOfReferenceUID, data.PatientName, data.PatientID = own, "Rossi^Mario", "P1"
    data.RegistrationSequence = [item(*each, kind) for each in items]
    data.save_as(path, enforce_file_format=True)
    return path


def item(frame: str | None, matrix: FloatArray | None, images: list[str], kind: str) -> Dataset:
    out = Dataset()
    if frame is not None:
        out.FrameOfReferenceUID = frame
    for uid in images:
        image = Dataset()
        image.ReferencedSOPClassUID, image.ReferencedSOPInstanceUID = "1.2.840.10008.5.1.4.1.1.2", uid
        out.ReferencedImageSequence = [*(out.get("ReferencedImageSequence") or []), image]
    if matrix is not None:
        step, whole = Dataset(), Dataset()
        step.FrameOfReferenceTransformationMatrix = [f"{value:.10g}" for value in matrix.ravel()]
        step.FrameOfReferenceTransformationMatrixType = kind
        whole.MatrixSequence = [step]
        out.MatrixRegistrationSequence = [whole]
    return out


def frames(pair: tuple) -> tuple[str, str]:
    return pair[1].frame_of_reference_uid, pair[2].frame_of_reference_uid


def test_the_matrix_is_read_in_both_directions_and_through_a_third_frame(pair: tuple, tmp_path: Path) -> None:
    """Whichever scan a system calls fixed, the answer brings the deformed scan to the one at rest."""
    rest, deformed = frames(pair)
    third, world = moving((-7.0, 5.0, 9.0), (30.0, -20.0, 10.0)), generate_uid()
    images = list(pair[2].sop_uids[:2])
    written = {
        "rest fixed": (rest, [(rest, np.eye(4), []), (deformed, TRUTH, [])]),
        "rest moving": (deformed, [(deformed, np.eye(4), []), (rest, BACK, [])]),
        "moving first": (rest, [(deformed, TRUTH, []), (rest, np.eye(4), [])]),
        "the fixed one unsaid": (rest, [(deformed, TRUTH, [])]),
        "both moving": (world, [(rest, third, []), (deformed, third @ TRUTH, [])]),
        "by its images": (rest, [(rest, np.eye(4), []), (None, TRUTH, images)]),
    }
    for name, (own, items) in written.items():
        found = read_registration(reg(tmp_path / "r.dcm", own, items), pair[1], pair[2])
        np.testing.assert_allclose(found, TRUTH, atol=1e-6, err_msg=name)


def test_a_point_goes_where_the_standard_says(pair: tuple, tmp_path: Path) -> None:
    """DICOM PS3.3 C.20.2: the item's matrix times a point of its frame is the point of the registration's."""
    rest, deformed = frames(pair)
    shift = np.eye(4)
    shift[:3, 3] = [10.0, 0.0, 0.0]
    found = read_registration(reg(tmp_path / "r.dcm", rest, [(deformed, shift, [])]), pair[1], pair[2])
    np.testing.assert_allclose(found @ [1.0, 2.0, 3.0, 1.0], [11.0, 2.0, 3.0, 1.0])


def test_registrations_that_are_not_of_the_two_scans_or_not_rigid(pair: tuple, tmp_path: Path) -> None:
    rest, deformed = frames(pair)
    other, path = generate_uid(), tmp_path / "r.dcm"
    scaled, mirrored, broken = np.diag([1.1, 1.1, 1.1, 1.0]), np.diag([-1.0, 1.0, 1.0, 1.0]), np.eye(4)
    broken[3, 0] = 0.1
    for own, items, message in (
        (rest, [(rest, np.eye(4), []), (other, TRUTH, [])], "registers other frames of reference"),
        (other, [(other, np.eye(4), []), (deformed, TRUTH, [])], "registers other frames of reference"),
        (other, [], "registers other frames of reference"),
        (rest, [(deformed, scaled, [])], "is not rigid: its matrix scales"),
        (rest, [(deformed, mirrored, [])], "is not rigid"),
        (rest, [(deformed, broken, [])], "is not rigid"),
        (rest, [(deformed, None, [])], "lacks a matrix of 16 numbers"),
        (rest, [(deformed, TRUTH[:3], [])], "lacks a matrix of 16 numbers"),
        (rest, [(deformed, TRUTH, []), (deformed, BACK, [])], "has several matrices for one of the scans"),
        (rest, [(other, TRUTH, list(pair[2].sop_uids))], "registers other frames of reference"),
    ):
        with pytest.raises(InputError, match=message) as caught:
            read_registration(reg(path, own, items), pair[1], pair[2])
        assert str(caught.value).startswith(str(path)) and "Rossi" not in str(caught.value)


def deformable(path: Path, pair: tuple) -> Path:
    rest, deformed = frames(pair)
    data = pydicom.dcmread(reg(path, rest, []))
    data.SOPClassUID = data.file_meta.MediaStorageSOPClassUID = DeformableSpatialRegistrationStorage
    source = Dataset()
    source.SourceFrameOfReferenceUID = deformed
    data.DeformableRegistrationSequence = [source]
    data.save_as(path)
    return path


def test_other_files_are_refused_by_what_they_are(pair: tuple, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"d\.dcm is a deformable registration; a rigid one is needed"):
        read_registration(deformable(tmp_path / "d.dcm", pair), pair[1], pair[2])
    with pytest.raises(InputError, match=r"CT_001\.dcm is no DICOM registration"):
        read_registration(pair[0] / "rest" / "CT_001.dcm", pair[1], pair[2])
    with pytest.raises(InputError, match=r"n\.dcm is not there"):
        read_registration(tmp_path / "n.dcm", pair[1], pair[2])


def test_two_scans_of_one_frame_are_told_apart_by_their_images_only(pair: tuple, tmp_path: Path) -> None:
    rest, _ = frames(pair)
    here, there = pair[1], dataclasses.replace(pair[2], frame_of_reference_uid=rest)
    own, moved = list(here.sop_uids[:1]), list(there.sop_uids[:1])
    found = read_registration(
        reg(tmp_path / "r.dcm", rest, [(rest, np.eye(4), own), (rest, TRUTH, moved)]), here, there
    )
    np.testing.assert_allclose(found, TRUTH, atol=1e-6)
    with pytest.raises(InputError, match="does not name the images of both scans"):
        read_registration(reg(tmp_path / "r.dcm", rest, [(rest, TRUTH, [])]), here, there)


def test_an_import_aligns_by_it_and_its_own_export_says_the_same(pair: tuple, tmp_path: Path) -> None:
    rest, deformed = frames(pair)
    nearly = moving((0.0, 0.0, 0.0), (0.2, 0.0, 0.0)) @ TRUTH
    given = reg(tmp_path / "r.dcm", rest, [(rest, np.eye(4), []), (deformed, nearly, [])])
    folders = pair[0] / "rest", pair[0] / "deformed"
    summary = run_import(*folders, tmp_path / "case", ImportOptions(registration=given))
    case = CaseFolder(tmp_path / "case")
    np.testing.assert_allclose(case.deformed_to_rest(), nearly, atol=1e-6)
    assert "aligned by the registration that was given, not on bone" in summary["notes"]
    assert "aligned by the registration, bones agree to 0." in text_of(summary)[0]
    (written,) = export.exporter("dicom-reg").export(case, tmp_path)
    np.testing.assert_allclose(read_registration(written, pair[1], pair[2]), nearly, atol=1e-6)
    # Another file is another import.
    again = reg(tmp_path / "r.dcm", rest, [(deformed, TRUTH, [])])
    run_import(*folders, tmp_path / "case", ImportOptions(registration=again))
    np.testing.assert_allclose(CaseFolder(tmp_path / "case").deformed_to_rest(), TRUTH, atol=1e-6)


def test_from_python_it_aligns_too(pair: tuple, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The scans hold no organs: what is asked is what the import made of them."""

    def reached(*_: object) -> None:
        raise InterruptedError

    monkeypatch.setattr("palpate.ui.python.from_scans.run_segment", reached)
    rest, deformed = frames(pair)
    nearly = moving((0.0, 0.0, 0.0), (0.2, 0.0, 0.0)) @ TRUTH
    given = reg(tmp_path / "r.dcm", rest, [(deformed, nearly, [])])
    with pytest.raises(InterruptedError):
        palpate.analyze(pair[0] / "rest", pair[0] / "deformed", tmp_path / "case", registration=given)
    np.testing.assert_allclose(CaseFolder(tmp_path / "case").deformed_to_rest(), nearly, atol=1e-6)


def test_a_matrix_the_wrong_way_round_is_noticed_by_the_bones(pair: tuple, tmp_path: Path) -> None:
    rest, deformed = frames(pair)
    given = reg(tmp_path / "r.dcm", rest, [(deformed, BACK, [])])
    with pytest.raises(InputError, match=r"r\.dcm: .*; leave it out to align on bone"):
        run_import(pair[0] / "rest", pair[0] / "deformed", tmp_path / "case", ImportOptions(registration=given))
    assert not (tmp_path / "case").exists()


def test_one_that_lies_there_is_told(pair: tuple, tmp_path: Path) -> None:
    """Within a scan's folder or beside it; one of other frames is not about these scans."""
    rest, deformed = frames(pair)
    for word in ("rest", "deformed"):
        shutil.copytree(pair[0] / word, tmp_path / word)
    reg(tmp_path / "beside.dcm", rest, [(deformed, TRUTH, [])])
    reg(tmp_path / "rest" / "within.dcm", deformed, [(rest, BACK, [])])
    reg(tmp_path / "foreign.dcm", generate_uid(), [(generate_uid(), TRUTH, [])])
    deformable(tmp_path / "bent.dcm", pair)
    notes = run_import(tmp_path / "rest", tmp_path / "deformed", tmp_path / "case", ImportOptions(align=False))["notes"]
    told = sorted(note for note in notes if "registration" in note)
    assert [note.split()[0] for note in told] == ["bent.dcm", "beside.dcm", "within.dcm"]
    assert "was not used; --registration FILE aligns by it" in told[1] and "cannot be used" in told[0]


def test_it_needs_two_dicom_scans_to_be_aligned(pair: tuple, tmp_path: Path) -> None:
    given = reg(tmp_path / "r.dcm", frames(pair)[0], [(frames(pair)[1], TRUTH, [])])
    both = ImportOptions(registration=given, align=False)
    with pytest.raises(InputError, match=r"r\.dcm aligns two CTs; leave it out for label volumes and for scans in one"):
        run_import(pair[0] / "rest", pair[0] / "deformed", tmp_path / "case", both)
