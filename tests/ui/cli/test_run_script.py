"""./run: made once, made again when the lock changes or a set-up was cut short, safe when two start at once.

Python is played by a small script that notes what it is asked to do, so that these tests need no network and no minutes.
"""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.skipif(sys.platform == "win32" or not shutil.which("bash"), reason="needs bash")

PYTHON = """#!/usr/bin/env bash
echo "$*" >>"$LOG"
case "$1 $2" in
"-m venv") mkdir -p "$3/bin" && cp "$0" "$3/bin/python" ;;
"-m pip") sleep "${PIP_SECONDS:-0}" ;;
"-m palpate.ui.pictures.offscreen") exit "${RENDERS:-0}" ;;
"-m palpate.ui.system_libraries") printf '%s' "${LACKS:-}" ;;
"-m palpate.ui.cli") printf '<%s>' "${@:3}"; printf ' in %s, safe %s' "$PWD" "$PYTHONSAFEPATH"; exit "${STATUS:-0}" ;;
esac
"""


@pytest.fixture
def project(tmp_path: Path) -> Path:
    """A copy of ./run beside a lock, in a folder with a space in its name."""
    top = tmp_path / "my project"
    top.mkdir()
    shutil.copy(TOP / "run", top / "run")
    (top / "requirements.lock").write_text("numpy==2.0\n")
    (top / "pyproject.toml").write_text("[project]\n")
    python = tmp_path / "python"
    python.write_text(PYTHON)
    python.chmod(0o755)
    return top


def start(project: Path, *arguments: str, **environment: str) -> subprocess.Popen[str]:
    variables = {"PALPATE_PYTHON": str(project.parent / "python"), "LOG": str(project.parent / "log")}
    return subprocess.Popen(
        [str(project / "run"), *arguments], cwd="/", env={**os.environ, **variables, **environment}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip


def run(project: Path, *arguments: str, **environment: str) -> tuple[int, str, str]:
    process = start(project, *arguments, **environment)
    out, err = process.communicate(timeout=30)
    return process.returncode, out, err


def asked(project: Path, what: str) -> int:
    """How often Python was asked to do something."""
    return sum(what in line for line in (project.parent / "log").read_text().splitlines())


def test_arguments_folder_and_status_pass_through(project: Path) -> None:
    status, out, _ = run(project, "palpate", "mesh", "a case", "", STATUS="4")
    assert (status, out) == (4, "<mesh><a case><> in /, safe 1")


def test_environment_is_made_once(project: Path) -> None:
    run(project, "palpate", "doctor")
    run(project, "palpate", "doctor")
    assert asked(project, "-m venv") == 1
    assert asked(project, "--require-hashes") == 1
    assert asked(project, "-e ") == 1


def test_environment_is_made_again_when_the_lock_changes(project: Path) -> None:
    run(project, "palpate", "doctor")
    (project / "requirements.lock").write_text("numpy==2.1\n")
    run(project, "palpate", "doctor")
    assert asked(project, "-m venv") == 2
    (project / "pyproject.toml").write_text("[project]\nname = 'x'\n")
    run(project, "palpate", "doctor")
    assert (asked(project, "-m venv"), asked(project, "-e ")) == (2, 3)


def test_a_set_up_that_was_cut_short_is_made_again(project: Path) -> None:
    first = start(project, "palpate", "doctor", PIP_SECONDS="30")
    deadline = time.monotonic() + 10.0
    while not ((project.parent / "log").exists() and asked(project, "-m pip")) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(first.pid, signal.SIGKILL)
    first.communicate()
    status, out, _ = run(project, "palpate", "doctor")
    assert (status, out[:8]) == (0, "<doctor>")
    assert asked(project, "-m venv") == 2


@pytest.mark.skipif(not shutil.which("flock"), reason="flock is not installed")
def test_two_runs_at_once_make_one_environment(project: Path) -> None:
    runs = [start(project, "palpate", "doctor", PIP_SECONDS="0.5") for _ in range(3)]
    assert all(process.communicate(timeout=30)[0].startswith("<doctor>") for process in runs)
    assert asked(project, "-m venv") == 1


def test_demo_is_the_main_job_on_the_sample(project: Path) -> None:
    _, out, _ = run(project, "demo", "--quiet")
    sample = project / "sample_dicom"
    assert out.startswith(f"<analyze><{sample}/rest><{sample}/deformed>")
    assert f"<-o><{project}/demo_case><--quiet>" in out


def test_without_rendering_it_goes_on_and_prints_one_line(project: Path, tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "id").write_text("#!/bin/sh\necho 1000\n")  # nobody who may install
    (tools / "id").chmod(0o755)
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    status, out, err = run(project, "palpate", "doctor", RENDERS="1", PATH=path)
    assert (status, out[:8]) == (0, "<doctor>")
    lines = [line for line in err.splitlines() if "3D" in line]
    assert len(lines) == 1 and "sudo sh -c 'apt-get update && apt-get install" in lines[0]
    assert "libegl1 libgl1-mesa-dri" in lines[0]


def test_what_the_window_lacks_is_named_in_one_line(project: Path, tmp_path: Path) -> None:
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "id").write_text("#!/bin/sh\necho 1000\n")
    (tools / "id").chmod(0o755)
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    status, _, err = run(project, "palpate", "doctor", LACKS="libxcb-cursor0 libegl1", RENDERS="1", PATH=path)
    (line,) = [line for line in err.splitlines() if "apt-get install" in line]
    assert status == 0 and "no 3D pictures and window on this machine yet" in line
    assert line.endswith("--no-install-recommends libegl1 libgl1-mesa-dri libxcb-cursor0'")
    _, _, err = run(project, "palpate", "doctor", LACKS="libxcb-cursor0", PATH=path)
    assert "apt-get" not in err, "said once"
    _, _, err = run(project, "setup", LACKS="libxcb-cursor0", PATH=path)
    assert "no window on this machine yet" in err and err.rstrip().endswith("--no-install-recommends libxcb-cursor0'")


@pytest.mark.parametrize("arguments", [(), ("feel",)])
def test_wrong_usage_is_2(project: Path, arguments: tuple[str, ...]) -> None:
    status, out, err = run(project, *arguments)
    assert (status, out) == (2, "")
    assert "./run demo" in err and "./run test" in err and "./run palpate" in err


def test_no_python_is_3_and_says_what_to_install(project: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare"
    bare.mkdir()
    for tool in ("bash", "env", "dirname", "readlink", "sed", "cat", "sha256sum", "flock"):
        found = shutil.which(tool)
        if found:
            (bare / tool).symlink_to(found)
    status, _, err = run(project, "palpate", "doctor", PATH=str(bare), PALPATE_PYTHON="")
    assert status == 3
    assert "no Python 3.11 or newer" in err and "apt-get install python3 python3-venv" in err
