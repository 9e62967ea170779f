"""The finished sample that comes with the program: small, up to date, and made whole before anything is computed from it."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path

import numpy as np
import pytest

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.diagnosed import read_diagnosis
from palpate.case.identified import map_arrays, read_result
from palpate.case.problem import problem_of
from palpate.case.sample import finished
from palpate.case.sample.finished import finished_archive, pack, unpack
from palpate.case.sample.scans import sample_folder
from palpate.case.slimmed import slim_files
from palpate.case.steps import diagnose, identify, match, segment
from palpate.case.steps.declarations import STEPS
from palpate.case.steps.whole import make_whole
from palpate.core.errors import InputError

AGAIN = "run .venv/bin/python docs/write_sample.py"


def no_job(*_: object) -> dict[str, object]:
    raise AssertionError(f"the sample was made by other options or another form of this step; {AGAIN}")


@pytest.fixture
def sample(tmp_path: Path) -> CaseFolder:
    return unpack(tmp_path / "home" / "finished")


def test_it_takes_a_few_megabytes() -> None:
    assert finished_archive().stat().st_size < 4e6


def test_nothing_in_it_is_out_of_date(sample: CaseFolder) -> None:
    judged = {step.name: step.out_of_date(sample) for step in STEPS if sample.step_record(step.name)}
    assert {"segment", "mesh", "match", "identify", "diagnose"} <= judged.keys()
    assert not any(judged.values()), f"{judged}; {AGAIN}"
    assert slim_files(sample), "it is hashed as whole though it is not"


def test_every_step_passes_over_it(sample: CaseFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the options that this program takes where nobody chooses any."""
    monkeypatch.setattr(match, "matched_motion", no_job)
    monkeypatch.setattr(segment, "segmented_beside", no_job)
    result = identify.run(sample, do_job=no_job)
    assert {"prostate_left", "prostate_right"} == result.parameters.keys()
    assert diagnose.run(sample, do_job=no_job).verdict
    before = sample.file("state.json").stat().st_mtime_ns
    segment.run_segment(sample)
    assert sample.file("state.json").stat().st_mtime_ns == before, AGAIN


def test_what_is_shown_of_it_is_there(sample: CaseFolder) -> None:
    result = read_result(sample)
    assert map_arrays(sample, result) is not None
    assert read_diagnosis(sample).where.map == "diagnose/gap_maps.npz" and sample.has("diagnose/gap_maps.npz")
    for state in ("rest", "deformed"):
        assert sample.labels(state).array.any() and sample.ct(state).array.any()


def test_it_names_no_folder_of_the_one_who_made_it(sample: CaseFolder) -> None:
    texts = [path.read_text(encoding="utf-8") for path in sample.path.rglob("*.json")]
    assert texts and not any(place in text for text in texts for place in ("/tmp/", "/home/", "/work/"))


def test_nothing_is_computed_from_its_slim_files(sample: CaseFolder) -> None:
    """An organ's surface without its voxels' errors would be fitted too surely, and without a word."""
    with pytest.raises(
        InputError, match=r"surfaces\.npz holds only what is shown of the finished sample; run `palpate mesh`"
    ):
        problem_of(sample)


@pytest.mark.nightly
def test_made_whole_it_is_what_was_computed_from(sample: CaseFolder) -> None:
    """The surfaces of labels, and the motion of scans, made anew here, have the hashes of those that the sample's results had."""
    make_whole(sample)
    assert not {"surfaces.npz", "matched_motion.npz"} & set(slim_files(sample))
    assert not any(step.out_of_date(sample) for step in STEPS if sample.step_record(step.name)), AGAIN
    identify.run(sample, do_job=no_job)


@pytest.mark.nightly
def test_this_program_finds_the_labels_of_the_sample(sample: CaseFolder, tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    shutil.copytree(sample.path, begun)
    for name in ("rest.nii.gz", "deformed.nii.gz"):
        (begun / name).unlink()
    segment.run_segment(CaseFolder(begun))
    for state in ("rest", "deformed"):
        assert np.array_equal(CaseFolder(begun).labels(state).array, sample.labels(state).array), AGAIN


def test_one_that_is_there_is_left_as_it_is(sample: CaseFolder) -> None:
    sample.write_text("measurements.json", "[]")
    before = {path: file_sha256(path) for path in sample.path.rglob("*") if path.is_file()}
    unpack(sample.path)
    assert before == {path: file_sha256(path) for path in sample.path.rglob("*") if path.is_file()}


def test_packing_refuses_what_is_no_finished_case_of_the_pair(sample: CaseFolder, tmp_path: Path) -> None:
    """The shipped case has been packed once already: packed again it is the same."""
    pack(sample.path, tmp_path / "again.zip")
    with zipfile.ZipFile(tmp_path / "again.zip") as again, zipfile.ZipFile(finished_archive()) as first:
        assert set(again.namelist()) == set(first.namelist())
        assert json.loads(again.read("result.json")) == json.loads(first.read("result.json"))
    (slice_,) = (sample.file("rest_ct") / "0003.dcm",)
    slice_.write_bytes(slice_.read_bytes() + b"\0")
    with pytest.raises(InputError, match=r"0003\.dcm is no slice of the sample pair"):
        pack(sample.path, tmp_path / "other.zip")
    sample.remove("diagnosis.json")
    with pytest.raises(InputError, match=r"diagnosis\.json is not there; the sample is a case of `palpate demo`"):
        pack(sample.path, tmp_path / "unfinished.zip")


def test_a_damaged_archive_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "finished_case.zip").write_bytes(b"no archive")
    monkeypatch.setattr(finished, "sample_folder", lambda: tmp_path)
    with pytest.raises(InputError, match=r"finished_case\.zip is damaged; install Palpate again"):
        unpack(tmp_path / "case")
    assert not (tmp_path / "case").exists()
    (tmp_path / "finished_case.zip").unlink()
    with pytest.raises(InputError, match="is not there; install Palpate again"):
        unpack(tmp_path / "case")


def test_the_scans_are_those_of_the_pair(sample: CaseFolder) -> None:
    assert len(list(sample.file("rest_ct").iterdir())) == len(list((sample_folder() / "rest").iterdir()))
