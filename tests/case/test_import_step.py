"""Two scans to a case: content, restarts, kills, refusals."""

from __future__ import annotations

import json
import multiprocessing
import os
import shutil
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pydicom
import pytest
from bone_scans import bone_labels, largest_error, moving, scan
from dicom_samples import structure_set
from drawn_contours import user_labels

from palpate.case.case_folder import CaseFolder
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.case.steps.import_scans.write import gravity_of
from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.contours.user_labels import read_user_labels
from palpate.imaging.dicom.series import read_series
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume

TRUTH = moving((2.0, -1.0, 3.0), (4.0, 2.0, -6.0))


def identity(word: str, patient: str = "P1") -> SeriesIdentity:
    return SeriesIdentity(patient, "Rossi^Mario", "study", word, word, 1, "study", word, "made for a test")


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("pair")
    write_ct_series(folder / "rest", scan(), identity("rest"), compress=False)
    write_ct_series(folder / "deformed", scan(TRUTH), identity("deformed"), compress=False)
    yield folder


def tree(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_a_pair_becomes_a_case_in_one_frame(pair: Path, tmp_path: Path) -> None:
    told: list[float] = []
    summary = run_import(pair / "rest", pair / "deformed", tmp_path / "case", progress=lambda f, m: told.append(f))
    assert told == sorted(told) and told[-1] == 1.0
    assert summary["residual_mm"] < 0.4 and summary["notes"] == []
    case = CaseFolder(tmp_path / "case")
    assert case.facts.name == "case" and case.facts.gravity_rest == (0.0, 9.81, 0.0)
    assert largest_error(case.deformed_to_rest(), TRUTH) < 0.2
    names = sorted(p.name for p in case.file("rest_ct").iterdir())
    assert names[0] == "0001.dcm" and len(names) == 33
    original, facts = read_series(pair / "rest")
    np.testing.assert_array_equal(case.ct("rest").array, original.array)
    assert case.series("rest")[1].sop_uids == facts.sop_uids
    # Seen in the rest frame, the deformed scan shows the same bone at the same place.
    bone = [
        v.to_lps(np.argwhere(v.array > 390).astype(float)).mean(axis=0) for v in (case.ct("rest"), case.ct("deformed"))
    ]
    np.testing.assert_allclose(bone[0], bone[1], atol=0.4)


def test_a_rerun_does_nothing_and_another_pair_is_refused(pair: Path, tmp_path: Path) -> None:
    options = ImportOptions(align=False)
    first = run_import(pair / "rest", pair / "deformed", tmp_path / "case", options)
    before = {p: p.stat().st_mtime_ns for p in (tmp_path / "case").rglob("*")}
    assert run_import(pair / "rest", pair / "deformed", tmp_path / "case", options) == first
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "case").rglob("*")} == before
    with pytest.raises(InputError, match="is the case of other scans; choose a new folder"):
        run_import(pair / "deformed", pair / "rest", tmp_path / "case", options)


def _import_until(after: int, pair: Path, case: Path) -> None:
    """Imports, and kills its own process when a file is put in its place for the ``after``-th time."""
    replace, count = os.replace, 0

    def counting(source: Path, target: Path) -> None:
        nonlocal count
        count += 1
        if count == after:
            os.kill(os.getpid(), signal.SIGKILL)
        replace(source, target)

    os.replace = counting  # type: ignore[assignment]
    run_import(pair / "rest", pair / "deformed", case, ImportOptions(align=False))


def test_killed_at_any_write_a_rerun_gives_the_same_case(pair: Path, tmp_path: Path) -> None:
    case = tmp_path / "case"
    run_import(pair / "rest", pair / "deformed", case, ImportOptions(align=False))
    whole = tree(case)
    for after in range(1, 9):
        shutil.rmtree(case)
        child = multiprocessing.get_context("fork").Process(target=_import_until, args=(after, pair, case))
        child.start()
        child.join()
        assert child.exitcode == -signal.SIGKILL, f"only {after - 1} files are put in place"
        run_import(pair / "rest", pair / "deformed", case, ImportOptions(align=False))
        assert tree(case) == whole


def drawn(volume: Volume) -> Volume:
    """Two organs and bone on the volume's grid."""
    labels = bone_labels(volume).array.copy()
    labels[30:36, 20:26, 10:14], labels[36:42, 20:26, 10:14] = 2, 1
    return volume.with_array(labels)


def test_drawn_labels_and_landmarks_come_along_in_the_rest_frame(pair: Path, tmp_path: Path) -> None:
    rest, _ = read_series(pair / "rest")
    _, facts = read_series(pair / "deformed")
    write_labels(tmp_path / "rest.nii.gz", drawn(rest))
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    rings = [
        np.stack([8 + 15 * np.cos(angle), 2 + 12 * np.sin(angle), np.full(60, z)], axis=1) for z in (0.0, 3.0, 6.0)
    ]
    structure_set({"Prostata": rings}, facts.frame_of_reference_uid).save_as(tmp_path / "rs.dcm")
    head = "name,rest_x,rest_y,rest_z,deformed_x,deformed_y,deformed_z\n"
    own = np.linalg.inv(TRUTH) @ [5.0, 6.0, 7.0, 1.0]
    (tmp_path / "points.csv").write_text(f"{head}seed,5,6,7,{own[0]},{own[1]},{own[2]}\n")
    options = ImportOptions(
        labels=(tmp_path / "rest.nii.gz", tmp_path / "rs.dcm"), landmarks=tmp_path / "points.csv", name="mine"
    )
    summary = run_import(pair / "rest", pair / "deformed", tmp_path / "case", options)
    assert "deformed: prostate is Prostata" in summary["notes"]
    case = CaseFolder(tmp_path / "case")
    said = json.loads(case.file("user_labels.json").read_text())
    assert said["rest"]["prostate_is_split"] and "prostate_right" in said["rest"]["labels"]
    assert said["deformed"] == {
        "source": "rtstruct",
        "labels": ["prostate_left"],
        "prostate_is_split": False,
        "structures": {"prostate": ["Prostata"]},
    }
    user = user_labels(case, "deformed")
    assert user is not None
    place = user.to_lps(np.argwhere(user.array == 1).astype(float)).mean(axis=0)
    np.testing.assert_allclose(place, (TRUTH @ [8.0, 2.0, 3.0, 1.0])[:3], atol=0.4)
    points = case.landmarks()
    assert points is not None
    np.testing.assert_allclose(points.deformed, points.rest, atol=0.2)
    # A forgotten option must not take away what a result stands on.
    with pytest.raises(InputError, match="was made with --rest-labels and --deformed-labels; give the same again"):
        run_import(pair / "rest", pair / "deformed", tmp_path / "case", ImportOptions(align=False))
    assert user_labels(CaseFolder(tmp_path / "case"), "rest") is not None


def test_a_whole_prostate_in_a_nifti_is_named_by_its_number(pair: Path, tmp_path: Path) -> None:
    scan, _ = read_series(pair / "rest")
    whole = drawn(scan)
    write_labels(tmp_path / "mask.nii.gz", whole.with_array((whole.array > 0).astype(np.uint8)))
    alone = read_user_labels(tmp_path / "mask.nii.gz", scan)
    assert alone.prostate_is_split and "give --roi prostate=1" in alone.notes[0]
    named = read_user_labels(tmp_path / "mask.nii.gz", scan, roi={"prostate": ["1"]})
    assert not named.prostate_is_split and not named.notes
    with pytest.raises(InputError, match="has numbers, not names: give --roi ORGAN=NUMBER"):
        read_user_labels(tmp_path / "mask.nii.gz", scan, roi={"prostate": ["Prostata"]})


def test_two_label_volumes_become_a_case(tmp_path: Path) -> None:
    rest, deformed = drawn(scan()), drawn(scan(TRUTH))
    write_labels(tmp_path / "a.nii.gz", rest)
    write_labels(tmp_path / "b.nii.gz", deformed)
    run_import(tmp_path / "a.nii.gz", tmp_path / "b.nii.gz", tmp_path / "case")
    case = CaseFolder(tmp_path / "case")
    assert largest_error(case.deformed_to_rest(), TRUTH) < 0.3
    found = case.labels("deformed")
    for value in (1, 2):
        own = deformed.to_lps(np.argwhere(deformed.array == value).astype(float)).mean(axis=0)
        seen = found.to_lps(np.argwhere(found.array == value).astype(float)).mean(axis=0)
        np.testing.assert_allclose(seen, (TRUTH @ [*own, 1.0])[:3], atol=0.3)
    with pytest.raises(InputError, match="hold the same labels"):
        run_import(tmp_path / "a.nii.gz", tmp_path / "a.nii.gz", tmp_path / "other")


def test_wrong_input_gives_one_line_and_no_folder(pair: Path, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.txt").write_text("hello")
    shutil.copytree(pair / "rest", tmp_path / "gap")
    sorted((tmp_path / "gap").iterdir())[12].unlink()
    write_ct_series(tmp_path / "other", scan(TRUTH), identity("other", "P2"), compress=False)
    rest, deformed = pair / "rest", pair / "deformed"
    for one, two, message in [
        (tmp_path / "empty", deformed, "empty is empty; give"),
        (rest, rest, "hold the same scan"),
        (tmp_path / "gap", deformed, "a slice is missing between"),
        (rest, tmp_path / "other", "are of two patients"),
        (tmp_path / "text.txt", deformed, r"text.txt is no scan; give a folder with a DICOM CT series"),
        (tmp_path / "absent", deformed, "absent is not there"),
    ]:
        with pytest.raises(InputError, match=message) as caught:
            run_import(one, two, tmp_path / "case")
        assert "\n" not in str(caught.value) and "Rossi" not in str(caught.value)
        assert not (tmp_path / "case").exists()


def test_a_read_only_output_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    (tmp_path / "place").mkdir(mode=0o555)
    with pytest.raises(InputError, match=r"case cannot be written \(the place is read-only\)"):
        run_import(tmp_path / "absent", tmp_path / "absent", tmp_path / "place" / "case")


def test_gravity_follows_how_the_patient_lies() -> None:
    assert gravity_of("HFS") == gravity_of("FFS") == (0.0, 9.81, 0.0)
    assert gravity_of("FFP") == (0.0, -9.81, 0.0)
    assert gravity_of("HFDL") == (9.81, 0.0, 0.0) and gravity_of("HFDR") == (-9.81, 0.0, 0.0)
    assert gravity_of(None) is gravity_of("SITTING") is None


def test_copies_are_the_files_themselves(pair: Path, tmp_path: Path) -> None:
    run_import(pair / "rest", pair / "deformed", tmp_path / "case", ImportOptions(align=False))
    originals = {p.read_bytes() for p in (pair / "rest").iterdir()}
    copies = sorted((tmp_path / "case" / "rest_ct").iterdir())
    assert {p.read_bytes() for p in copies} == originals
    heights = [float(pydicom.dcmread(p).ImagePositionPatient[2]) for p in copies]
    assert heights == sorted(heights)
