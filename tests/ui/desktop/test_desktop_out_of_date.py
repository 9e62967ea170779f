"""The window calls a step out of date when the step itself would run again, and only then."""

from __future__ import annotations

import os
import shutil
import time
from dataclasses import asdict
from pathlib import Path

import pytest
from phantoms import labels, result, write_case

from palpate.case.case_folder import CaseFolder
from palpate.case.measured_noise import FILE as NOISE_FILE
from palpate.case.steps import diagnose, identify, mesh
from palpate.core.errors import Cancelled, InputError
from palpate.meshing.mesh_labels import MeshOptions
from palpate.ui.desktop.session import out_of_date as freshness
from palpate.ui.desktop.session.open_case import OpenCase
from palpate.ui.desktop.session.out_of_date import FileHashes, Freshness, judged
from palpate.ui.report import report_step
from palpate.ui.report.drawn_by import drawn_by


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    """A case that says of mesh and stiffness what they were made from."""
    made = write_case(tmp_path / "case")
    made.write_npz("mesh.npz", points=[1.0])
    made.write_npz("surfaces.npz", points=[2.0])
    options = asdict(MeshOptions())
    made.write_json("mesh.json", {"options": options, "quality": "as it was"})
    made.mark_done("mesh", made.inputs_sha256(freshness.MESH_INPUTS, options), ("mesh.npz", "mesh.json"))
    known = {n: made.inputs_sha256([n]) for n in ("rest.nii.gz", *freshness.IDENTIFY_INPUTS) if made.has(n)}
    made.write_json("result.json", result(inputs_sha256=known))
    return made


def out_of_date(case: CaseFolder) -> dict[str, str]:
    return {command: reason for command, reason in judged(case, FileHashes()) if reason}


def test_files_are_those_of_the_steps() -> None:
    assert (*identify.INPUTS, NOISE_FILE) == freshness.IDENTIFY_INPUTS
    assert freshness.DIAGNOSE_INPUTS == diagnose.INPUTS and freshness.REPORT_INPUTS == report_step.INPUTS


def test_a_copy_is_as_done_as_its_original_whatever_the_times_say(case: CaseFolder, tmp_path: Path) -> None:
    assert out_of_date(case) == {} and mesh.run(case)["quality"] == "as it was"  # the step does nothing either
    copy = CaseFolder(shutil.copytree(case.path, tmp_path / "copy"))
    for age, name in enumerate(("result.json", "mesh.json", "mesh.npz", "rest.nii.gz")):  # sources the newest
        os.utime(copy.file(name), (1e9 + age, 1e9 + age))
    assert out_of_date(copy) == {}


def test_what_has_been_changed_is_told_by_what_was_made_from_it(case: CaseFolder) -> None:
    times = {p: p.stat().st_mtime_ns for p in case.path.iterdir()}
    case.write_labels("deformed", labels(case.labels("rest").affine, push_mm=6.0))
    assert out_of_date(case) == {"mesh": "the labels have been changed since"}
    case.write_npz("mesh.npz", points=[3.0])
    for path, then in times.items():
        os.utime(path, ns=(then, then))
    assert out_of_date(case)["identify"] == "mesh.npz has been changed since"
    case.write_text("landmarks.csv", "new")
    assert out_of_date(case)["identify"] == "landmarks.csv has been changed since"


def test_the_diagnosis_and_the_report_are_judged_with_their_options(case: CaseFolder) -> None:
    case.write_json("diagnosis.json", {})
    chosen = {"seed": 7, "effects": {}, "meshes": 3}
    case.mark_done("diagnose", case.inputs_sha256(diagnose.INPUTS, chosen), ())
    assert "diagnose" in out_of_date(case)
    case.write_json("history.json", {"commands": [{"command": "diagnose", "options": "--meshes 3 --seed 7"}]})
    assert out_of_date(case) == {}
    case.write_text("report/report.html", "x")
    case.mark_done("report", case.inputs_sha256(report_step.INPUTS, [{"pdf": False}, drawn_by()]), ())
    assert out_of_date(case) == {}
    case.write_json("diagnosis.json", {"verdict": "none"})
    assert out_of_date(case) == {"report": "what it shows or the program has been changed since"}


def test_results_that_do_not_say_what_they_were_made_from_are_judged_by_their_times(case: CaseFolder) -> None:
    case.write_json("result.json", result(inputs_sha256={}))
    assert out_of_date(case) == {}
    later = time.time() + 10
    os.utime(case.file("surfaces.npz"), (later, later))
    assert out_of_date(case) == {"identify": "surfaces.npz is newer"}


def test_a_file_is_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Path] = []
    monkeypatch.setattr(freshness, "file_sha256", lambda path: str(read.append(path)) + path.read_text())
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
    opened, fresh = OpenCase(case.path), Freshness()
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
