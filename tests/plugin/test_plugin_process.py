"""The child process of the Slicer module: progress, results, errors, and a cancel after which nothing is left."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "plugin" / "PalpateStiffness"))

from PalpateStiffnessLib import program  # noqa: E402
from PalpateStiffnessLib.pipeline import CANCELLED, DONE, FAILED, RUNNING, Pipeline, Step  # noqa: E402
from PalpateStiffnessLib.process import ProgramCall, descendants  # noqa: E402
from PalpateStiffnessLib.program import ProgramNotFoundError, program_command  # noqa: E402


def python(code: str) -> list[str]:
    return [sys.executable, "-c", code]


WORKS = python(
    "import sys, time, json\n"
    "print('mesh 25 %: smooth surfaces', file=sys.stderr, flush=True)\n"
    "time.sleep(0.4)\n"
    "print('mesh 75 %: tetrahedra', file=sys.stderr, flush=True)\n"
    "time.sleep(0.2)\n"
    "print(json.dumps({'cells': 7, 'asked': sys.argv[1:]}))"
)
FAILS = python(
    "import sys, json; print(json.dumps({'error': 'a.dcm is damaged; copy it again', 'exit_code': 3})); sys.exit(3)"
)
# A worker in a session of its own that does not listen, as a numerical library may not.
STUBBORN = python(
    "import subprocess, sys, signal, time\n"
    "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
    "child = 'import signal, time; signal.signal(signal.SIGTERM, signal.SIG_IGN); time.sleep(60)'\n"
    "subprocess.Popen([sys.executable, '-c', child], start_new_session=True)\n"
    "print('identify 10 %: swarm', file=sys.stderr, flush=True)\n"
    "time.sleep(60)"
)


def is_alive(process: int) -> bool:
    state = Path(f"/proc/{process}/stat")
    return state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z"


def test_progress_while_it_runs_and_its_json_at_the_end() -> None:
    call = ProgramCall(WORKS)
    seen = set()
    while call.is_running:
        seen.add(call.fraction)
        time.sleep(0.02)
    assert {0.25, 0.75} & seen and call.exit_code == 0
    assert call.result() == {"cells": 7, "asked": ["--json"]} and call.error() == ""


def test_a_refusal_is_one_line() -> None:
    pipeline = Pipeline([Step("import", FAILS), Step("segment", WORKS)])
    assert pipeline.wait(20) == FAILED
    assert pipeline.error == "a.dcm is damaged; copy it again" and pipeline.results == {}


def test_steps_follow_each_other() -> None:
    pipeline = Pipeline([Step("import", WORKS, 1.0), Step("mesh", WORKS, 3.0)])
    fractions = []
    while pipeline.poll() == RUNNING:
        fractions.append(pipeline.fraction)
        time.sleep(0.02)
    assert pipeline.state == DONE and set(pipeline.results) == {"import", "mesh"}
    assert fractions == sorted(fractions) and max(fractions) > 0.8


@pytest.mark.skipif(sys.platform != "linux", reason="looks at /proc")
def test_cancel_leaves_no_process_within_a_second() -> None:
    pipeline = Pipeline([Step("identify", STUBBORN), Step("report", WORKS)])
    while "swarm" not in pipeline.message:
        assert pipeline.poll() == RUNNING
        time.sleep(0.02)
    assert pipeline._call is not None
    family = [pipeline._call.process.pid, *descendants(pipeline._call.process.pid)]
    assert len(family) == 2 and all(is_alive(p) for p in family)
    began = time.monotonic()
    pipeline.cancel()
    while any(is_alive(p) for p in family):
        assert time.monotonic() - began < 1.0
        time.sleep(0.01)
    assert time.monotonic() - began < 1.0
    assert pipeline.poll() == CANCELLED and "kept" in pipeline.message


def test_the_program_is_found_or_what_to_do_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("PALPATE", raising=False)
    run = tmp_path / "run"
    run.write_text("#!/bin/sh\n")
    with pytest.raises(ProgramNotFoundError, match="no program that can be run"):
        program_command(str(run))
    run.chmod(0o755)
    assert program_command(str(run)) == program_command(str(tmp_path)) == [str(run), "palpate"]
    assert program_command() == [str(ROOT / "run"), "palpate"]
    monkeypatch.setenv("PALPATE", sys.executable)
    assert program_command() == [sys.executable] and os.access(sys.executable, os.X_OK)


def test_on_windows_the_entry_is_run_cmd_and_never_the_shell_script(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(program, "_WINDOWS", True)
    monkeypatch.setattr(program, "ENTRY", "run.cmd")
    monkeypatch.delenv("PALPATE", raising=False)
    for name in ("run", "run.cmd"):
        (tmp_path / name).write_text("")
        (tmp_path / name).chmod(0o755)
    for given in (tmp_path, tmp_path / "run", tmp_path / "run.cmd"):
        assert program.program_command(str(given)) == [str(tmp_path / "run.cmd"), "palpate"]
    top = tmp_path / "clone"
    (top / "plugin" / "PalpateStiffness" / "PalpateStiffnessLib").mkdir(parents=True)
    monkeypatch.setattr(program, "__file__", str(top / "plugin/PalpateStiffness/PalpateStiffnessLib/program.py"))
    (top / "run").write_text("#!/bin/sh\n")
    (top / "run").chmod(0o755)
    own = tmp_path / "home" / ".palpate" / "environment" / "Scripts" / "palpate.exe"
    own.parent.mkdir(parents=True)
    own.write_text("")
    monkeypatch.setattr(Path, "home", lambda: tmp_path / "home")
    assert program.program_command() == [str(own)], "a shell script alone is no program there"
