"""The window calls a step out of date when the step itself would run again, and only then."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from diagnoses import diagnosis
from phantoms import labels, result, write_case

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import diagnose, mesh
from palpate.case.steps.declarations import DIAGNOSE, IDENTIFY, MESH
from palpate.core.errors import Cancelled, InputError
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.meshing.mesh_labels import MeshOptions
from palpate.ui.desktop.session import out_of_date as out_of_date_module
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.desktop.session.out_of_date import FileHashes, OutOfDateCheck, judged
from palpate.ui.report.declaration import REPORT


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    """A case that says of mesh and stiffness what they were made from."""
    made = write_case(tmp_path / "case")
    made.write_npz("mesh.npz", points=[1.0])
    made.write_npz("surfaces.npz", points=[2.0])
    options = asdict(MeshOptions())
    made.write_json("mesh.json", {"options": options, "quality": "as it was"})
    MESH.mark_done(made, MESH.made_from(made, mesh.chosen(MeshOptions())), ("mesh.npz", "mesh.json"))
    known = {n: made.inputs_sha256([n]) for n in ("rest.nii.gz", *IDENTIFY.inputs(made)) if made.has(n)}
    made.write_json("result.json", result(inputs_sha256=known))
    return made


Diagnose = Callable[..., Any]


@pytest.fixture
def diagnosed(monkeypatch: pytest.MonkeyPatch) -> Diagnose:
    """The diagnose step with its sums left out: what it reads, notes and passes over stays its own."""
    monkeypatch.setattr(diagnose, "data_of", lambda *_: diagnose.Remeshed(None, None))
    monkeypatch.setattr(diagnose, "remeshed", lambda *_: None)
    monkeypatch.setattr(diagnose, "replace", lambda data, **_: data)
    monkeypatch.setattr(diagnose, "arrays", lambda data: {})
    where = {"map": "gap_maps.npz", "regions": [], "peak_lps_mm": None}
    return partial(diagnose.run, do_job=lambda *_: diagnosis("none", where=where))


def out_of_date(case: CaseFolder) -> dict[str, str]:
    return {command: reason for command, reason in judged(case, FileHashes()) if reason}


def test_a_copy_is_as_done_as_its_original_whatever_the_times_say(case: CaseFolder, tmp_path: Path) -> None:
    assert out_of_date(case) == {} and mesh.run(case)["quality"] == "as it was"  # the step does nothing either
    copy = CaseFolder(shutil.copytree(case.path, tmp_path / "copy"))
    for age, name in enumerate(("result.json", "mesh.json", "mesh.npz", "rest.nii.gz")):  # sources the newest
        os.utime(copy.file(name), (1e9 + age, 1e9 + age))
    assert out_of_date(copy) == {}


def test_a_diagnosis_is_out_of_date_once_the_stiffness_stands_on_the_images(
    case: CaseFolder, diagnosed: Diagnose
) -> None:
    """No file that `diagnose` reads has changed then."""
    assert diagnosed(case).image is False
    assert out_of_date(case) == {}
    case.write_json("result.json", {**case.read_json("result.json"), "options": {"image": True}})
    assert out_of_date(case) == {
        "diagnose": "the diagnosis stands on the contours alone, the stiffness on the images too"
    }


def test_what_has_been_changed_is_told_by_what_was_made_from_it(case: CaseFolder) -> None:
    times = {p: p.stat().st_mtime_ns for p in case.path.iterdir()}
    case.write_labels("deformed", labels(case.labels("rest").affine, push_mm=6.0))
    assert out_of_date(case) == {"mesh": "deformed.nii.gz has been changed since"}
    case.write_npz("mesh.npz", points=[3.0])
    for path, then in times.items():
        os.utime(path, ns=(then, then))
    assert out_of_date(case)["identify"] == "mesh.npz has been changed since"
    case.write_text("landmarks.csv", "new")
    assert out_of_date(case)["identify"] == "landmarks.csv has been changed since"


def _write_third(case: CaseFolder, push_mm: float) -> None:
    with case.atomic_path("deformed_2.nii.gz") as path:
        write_labels(path, labels(case.labels("rest").affine, push_mm=push_mm))


@pytest.mark.parametrize("kind", ["plain", "noise.json", "further state"])
def test_a_fresh_diagnosis_is_up_to_date_whatever_the_case_has_beside(
    case: CaseFolder, kind: str, diagnosed: Diagnose
) -> None:
    """Of a case with noise.json or further states it was called out of date for ever."""
    if kind == "noise.json":
        case.write_json("noise.json", {"sd_mm": 0.3, "correlation_mm": 5.0})
    if kind == "further state":
        _write_third(case, push_mm=5.0)
        case.save_facts(replace(case.facts, other={"states": [{"name": "third", "labels": "deformed_2.nii.gz"}]}))
    assert "diagnose" not in dict(judged(case, FileHashes()))
    diagnosed(case, diagnose.DiagnoseOptions(seed=7, meshes=3))
    assert dict(judged(case, FileHashes()))["diagnose"] == ""
    changed = {"plain": "surfaces.npz", "noise.json": "noise.json", "further state": "deformed_2.nii.gz"}[kind]
    if kind == "further state":
        _write_third(case, push_mm=6.0)
    else:
        case.write_bytes(changed, case.file(changed).read_bytes() + b" ")
    assert out_of_date(case)["diagnose"] == f"{changed} has been changed since"
    diagnosed(case, diagnose.DiagnoseOptions())
    assert "diagnose" not in out_of_date(case)


def test_noise_measured_afterwards_puts_stiffness_and_diagnosis_out_of_date(
    case: CaseFolder, diagnosed: Diagnose
) -> None:
    diagnosed(case)
    case.write_json("noise.json", {"sd_mm": 0.3, "correlation_mm": 5.0})
    why = "noise.json has been changed since"
    assert out_of_date(case) == {"identify": why, "diagnose": why}


def test_a_case_of_an_earlier_version_is_judged_by_hashes_once_its_step_has_been_passed_over(
    case: CaseFolder, diagnosed: Diagnose
) -> None:
    diagnosed(case)
    state = case.read_json("state.json")
    del state["diagnose"]["inputs"]  # as it was noted before
    case.write_json("state.json", state)
    later = time.time() + 10
    os.utime(case.file("surfaces.npz"), (later, later))
    assert out_of_date(case) == {"diagnose": "surfaces.npz is newer"}
    diagnosed(case)
    assert out_of_date(case) == {}


def test_the_report_is_out_of_date_by_what_it_shows_and_by_the_program_that_drew_it(
    case: CaseFolder,
) -> None:
    case.write_text("report/report.html", "x")
    REPORT.mark_done(case, REPORT.made_from(case, {"pdf": False}), ())
    assert out_of_date(case) == {}
    case.write_json("diagnosis.json", diagnosis("none"))
    DIAGNOSE.mark_done(case, DIAGNOSE.made_from(case, {}), ())
    assert out_of_date(case) == {"report": "diagnosis.json has been changed since"}
    case.file("diagnosis.json").unlink()
    assert out_of_date(case) == {}
    other = replace(REPORT, program=lambda: "another program")
    assert other.out_of_date(case) == "the program has been changed since"
    assert not other.is_done(case, other.made_from(case, {"pdf": False}))
    assert REPORT.is_done(case, REPORT.made_from(case, {"pdf": False}))


def test_results_that_do_not_say_what_they_were_made_from_are_judged_by_their_times(case: CaseFolder) -> None:
    case.write_json("result.json", result(inputs_sha256={}))
    assert out_of_date(case) == {}
    later = time.time() + 10
    os.utime(case.file("surfaces.npz"), (later, later))
    assert out_of_date(case) == {"identify": "surfaces.npz is newer"}


def test_a_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Path] = []
    monkeypatch.setattr(out_of_date_module, "file_sha256", lambda path: str(read.append(path)) + path.read_text())
    hashes, path = FileHashes(), tmp_path / "x"
    path.write_text("a")
    assert hashes(path) == hashes(path) == "Nonea" and len(read) == 1
    path.write_text("bc")
    assert hashes(path) == "Nonebc"
    hashes.stop.set()
    with pytest.raises(Cancelled, match="the case is closed"):
        hashes(path)
    hashes.stop.clear()
    with pytest.raises(InputError, match="cannot be read"):
        hashes(tmp_path / "none")


def test_the_windows_thread_never_hashes_and_hears_only_of_the_open_case(case: CaseFolder) -> None:
    opened, fresh = OpenCase(case.path), OutOfDateCheck()
    fresh.start(opened)
    fresh.start(opened)
    assert fresh.running and fresh.reasons == {}
    end = time.monotonic() + 20
    while fresh.running:
        fresh.poll()
        assert time.monotonic() < end
        time.sleep(0.005)
    assert fresh.reasons == {"mesh": "", "identify": ""}
    fresh.start(opened)
    fresh.forget()
    fresh.poll()
    assert not fresh.running and fresh.reasons == {}
    fresh.close()
    opened.close()
