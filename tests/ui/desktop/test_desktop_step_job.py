"""Steps that the window runs: what a terminal does, one process below the window, gone when it is cancelled or the window has died."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import synthetic_case
from block_case import write_block_case
from phantoms import labels, write_case

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.steps import identify
from palpate.case.steps.declarations import IDENTIFY
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.core.identify.options import IdentifyOptions
from palpate.core.identify.result_record import ResultRecord
from palpate.core.worker.messages import Message
from palpate.core.worker.process import run_job
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.ui.cli import main as cli
from palpate.ui.cli.signals import descendants
from palpate.ui.desktop.session.jobs import JobControl
from palpate.ui.desktop.session.step_job import steps_job
from palpate.ui.desktop.session.step_requests import StepRequest, import_request, step_request

QUICK = IdentifyOptions(method="gauss-newton", element="p1p1", starts=1, stiffness_map=False)
LONG = IdentifyOptions(element="p1p1", particles=40, iterations=10000, workers=2, reduced=False, stiffness_map=False)
SEEDS = {"rest": {"prostate": [-6.5004, 11.0, -148.25]}, "deformed": {}}
# What differs from run to run without being a result.
_CLOCKS = ("seconds", "cpu_seconds", "date")

WINDOW = """
import sys, time
from palpate.ui.desktop.session.jobs import JobControl
from palpate.core.worker.job import Job
jobs = JobControl()
jobs.start(Job.load(__import__("pathlib").Path(sys.argv[1])), "Stiffness")
while not jobs.state.swarm.particles:
    jobs.poll()
    time.sleep(0.01)
print("at work", flush=True)
time.sleep(300)
"""


@pytest.fixture(scope="module")
def meshed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case that has been meshed: a block of two halves, pushed by the rectum's wall."""
    problem = synthetic_case.problem((30.0, 70.0), depth=4.5, fine=2)
    return write_block_case(tmp_path_factory.mktemp("meshed") / "case", problem, 4.5).path


@pytest.fixture
def case(meshed: Path, tmp_path: Path) -> CaseFolder:
    return CaseFolder(shutil.copytree(meshed, tmp_path / "case"))


def without_clocks(found: Any) -> Any:
    if isinstance(found, dict):
        return {key: without_clocks(value) for key, value in found.items() if key not in _CLOCKS}
    return [without_clocks(value) for value in found] if isinstance(found, list) else found


def as_json(found: ResultRecord) -> Any:
    return json.loads(json.dumps(plain(found)))


def start(case: CaseFolder, options: IdentifyOptions) -> JobControl:
    jobs = JobControl()
    jobs.start(steps_job([StepRequest(IDENTIFY, case.path, options)], case.file("desktop/job")), "Stiffness")
    return jobs


def wait_for_particles(jobs: JobControl) -> None:
    end = time.monotonic() + 120.0
    while jobs.state is not None and not jobs.state.swarm.particles:
        assert jobs.running and time.monotonic() < end, jobs.state.error
        jobs.poll()
        time.sleep(0.01)


def workers_of(process: int) -> list[int]:
    """Worker processes below a process, without the processes that evaluate particles."""
    found = []
    for each in descendants(process):
        words = Path(f"/proc/{each}/cmdline").read_bytes().split(b"\0")
        found += [each] if b"palpate.core.worker" in words else []
    return found


def test_the_window_finds_what_the_step_finds_in_a_terminal(case: CaseFolder, tmp_path: Path) -> None:
    other = CaseFolder(shutil.copytree(case.path, tmp_path / "other"))
    in_terminal = as_json(identify.run(other, QUICK))
    heard: list[Message] = []
    job = steps_job([StepRequest(IDENTIFY, case.path, QUICK)], case.file("desktop/job"))
    in_window = run_job(job, heard.append)["identify"]
    assert without_clocks(in_window) == without_clocks(in_terminal)
    assert without_clocks(case.read_json("result.json")) == without_clocks(other.read_json("result.json"))
    assert case.read_json("state.json") == other.read_json("state.json")
    assert sorted(p.name for p in case.file("identify").iterdir()) == sorted(
        p.name for p in other.file("identify").iterdir() if p.name not in ("messages.jsonl", "worker.log")
    )
    told = [m for m in heard if m["type"] == "progress"]
    assert {m["step"] for m in told} == {"identify"} and told[0]["message"] == "starting"
    fractions = [m["fraction"] for m in told]
    assert fractions == sorted(fractions) and fractions[-1] == 1.0
    assert as_json(identify.run(case, QUICK)) == case.read_json("result.json"), (
        "the terminal passes over what the window did"
    )


def test_history_is_that_of_a_terminal(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    seeds = "--seed prostate=-6.500,11.000,-148.250"
    for words in (["segment", str(case.path), *seeds.split()], ["segment", str(case.path)]):
        assert cli.main([*words, "--quiet"]) == 0
    requests = [step_request("segment", case.path, given, np.eye(4)) for given in (SEEDS, {})]
    run_job(steps_job(requests, case.file("desktop/job")))
    typed, typed_alone, clicked, clicked_alone = (
        (entry["command"], entry["options"]) for entry in case.read_json("history.json")["commands"]
    )
    assert typed == clicked == ("segment", f"CASE {seeds}") and typed_alone == clicked_alone == ("segment", "CASE")


def test_an_import_by_the_window_is_that_of_a_terminal(tmp_path: Path) -> None:
    scans = tmp_path / "rest.nii.gz", tmp_path / "full.nii.gz"
    affine = write_case(tmp_path / "shapes").labels("rest").affine
    for path, push in zip(scans, (0.0, 3.0), strict=True):
        write_labels(path, labels(affine, push_mm=push))
    assert cli.main(["import", *map(str, scans), "-o", str(tmp_path / "a"), "--quiet"]) == 0
    run_job(steps_job([import_request(*scans, tmp_path / "b")], tmp_path / "job"))
    typed, clicked = CaseFolder(tmp_path / "a"), CaseFolder(tmp_path / "b")
    histories = [without_clocks(one.read_json("history.json")) for one in (typed, clicked)]
    assert histories[0] == histories[1] and typed.read_json("state.json") == clicked.read_json("state.json")
    for name in ("rest.nii.gz", "deformed.nii.gz", "labels.txt", "alignment.json"):
        assert file_sha256(typed.file(name)) == file_sha256(clicked.file(name))


def test_one_process_below_the_window_and_none_when_it_is_cancelled(case: CaseFolder) -> None:
    before = set(descendants(os.getpid()))
    jobs = start(case, LONG)
    wait_for_particles(jobs)
    state = jobs.state
    assert state is not None and state.step == "identify" and 0.0 < state.fraction < 1.0
    if sys.platform == "linux":
        assert len(workers_of(os.getpid())) == 1
    jobs.cancel()
    asked = time.monotonic()
    while jobs.running:
        jobs.poll()
        time.sleep(0.005)
    assert not set(descendants(os.getpid())) - before and time.monotonic() - asked < 1.0
    assert state.outcome == "cancelled" and not case.has("result.json") and not case.has("history.json")


def test_the_step_dies_with_the_window(case: CaseFolder) -> None:
    job = case.file("asked.json")
    steps_job([StepRequest(IDENTIFY, case.path, LONG)], case.file("desktop/job")).save(job)
    window = subprocess.Popen([sys.executable, "-c", WINDOW, str(job)], stdout=subprocess.PIPE, text=True)
    assert window.stdout is not None and window.stdout.readline() == "at work\n"
    children = descendants(window.pid)
    assert len(children) >= 3  # the step and those that evaluate particles
    window.send_signal(signal.SIGKILL)
    window.wait()
    window.stdout.close()
    end = time.monotonic() + 5.0
    while any(Path(f"/proc/{child}").exists() and "\nState:\tZ" not in _status(child) for child in children):
        assert time.monotonic() < end, "a process outlived the window"
        time.sleep(0.02)


def _status(process: int) -> str:
    try:
        return Path(f"/proc/{process}/status").read_text()
    except OSError:
        return "\nState:\tZ"


def test_a_step_that_fails_is_no_part_of_the_history(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    case.file("result.json").write_text("{")
    with pytest.raises(InputError, match=r"result\.json is not valid JSON"):
        run_job(steps_job([step_request("report", case.path, {}, np.eye(4))], case.file("desktop/job")))
    assert not case.has("history.json")


def test_a_request_survives_its_way_to_the_worker() -> None:
    turned = np.diag([-1.0, -1.0, 1.0, 1.0])
    asked = step_request("segment", Path("/c"), {"rest": {}, "deformed": {"rectum": [1.0, 2.0, 3.0]}}, turned)
    again = StepRequest.from_dict(json.loads(json.dumps(asked.to_dict())))
    assert again.options.to_dict() == asked.options.to_dict() and again.typed == asked.typed
    assert again.options.prompts_deformed.seeds["rectum"].tolist() == [-1.0, -2.0, 3.0]
