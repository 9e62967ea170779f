"""run.py: the entry for every system. Python is played by a stand-in that notes what it is asked to do."""

from __future__ import annotations

import hashlib
import importlib.util
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

TOP = Path(__file__).resolve().parents[3]


class Asked:
    """Commands that were run, and the status that each gives."""

    def __init__(self) -> None:
        self.commands: list[list[str]] = []
        self.environment: dict[str, str] = {}
        self.status: Callable[[list[str]], int] = lambda command: 0

    def run(self, command: list[str], env: dict[str, str] | None = None, *_: object, **__: object) -> int:
        self.commands.append(command)
        self.environment = env or self.environment
        if command[1:3] == ["-m", "venv"]:
            python = Path(command[3]) / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
            python.parent.mkdir(parents=True)
            python.touch()
        return self.status(command)

    def count(self, word: str) -> int:
        return sum(word in command for command in self.commands)


@pytest.fixture
def entry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """run.py as if it lay in a folder with a space in its name, beside a lock."""
    top = tmp_path / "my project"
    top.mkdir()
    for name in ("requirements.lock", "pyproject.toml"):
        (top / name).write_text("one\n")
    spec = importlib.util.spec_from_file_location("run_entry", TOP / "run.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "TOP", top)
    monkeypatch.setattr(module, "VENV", top / ".venv")
    monkeypatch.setattr(module, "PYTHON", top / ".venv" / ("Scripts/python.exe" if os.name == "nt" else "bin/python"))
    return module


@pytest.fixture
def asked(entry: ModuleType, monkeypatch: pytest.MonkeyPatch) -> Asked:
    found = Asked()
    monkeypatch.setattr(entry, "_status", found.run)
    return found


def test_arguments_and_status_pass_through(entry: ModuleType, asked: Asked) -> None:
    asked.status = lambda command: 4 if "mesh" in command else 0
    assert entry.main(["palpate", "mesh", "a case", ""]) == 4
    assert asked.commands[-1] == [str(entry.PYTHON), "-m", "palpate.ui.cli", "mesh", "a case", ""]
    assert asked.environment["PYTHONSAFEPATH"] == "1" and "PYTHONPATH" not in asked.environment
    assert entry.main(["demo", "--quiet"]) == 0
    assert asked.commands[-1][3:] == ["analyze", *(str(entry.TOP / "sample_dicom" / s) for s in ("rest", "deformed")),
                                      "-o", str(entry.TOP / "demo_case"), "--quiet"]  # fmt: skip


def test_the_environment_is_made_once_and_again_when_lock_or_project_change(entry: ModuleType, asked: Asked) -> None:
    for _ in range(2):
        assert entry.main(["setup"]) == 0
    assert (asked.count("venv"), asked.count("--require-hashes"), asked.count("-e")) == (1, 1, 1)
    (entry.TOP / "pyproject.toml").write_text("two\n")
    entry.main(["setup"])
    assert (asked.count("venv"), asked.count("-e")) == (1, 2)
    (entry.TOP / "requirements.lock").write_text("two\n")
    entry.main(["setup"])
    assert asked.count("venv") == 2 and asked.count("-e") == 3, "a new environment has no project yet"


def test_a_failed_installation_is_told_and_tried_again(
    entry: ModuleType, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    asked.status = lambda command: int("--require-hashes" in command)
    assert entry.main(["palpate", "doctor"]) == 3
    assert "check the network and run again" in capsys.readouterr().err and asked.count("doctor") == 0
    asked.status = lambda command: 0
    assert entry.main(["palpate", "doctor"]) == 0 and asked.count("venv") == 2


def test_an_unknown_command_shows_the_usage(
    entry: ModuleType, asked: Asked, capsys: pytest.CaptureFixture[str]
) -> None:
    assert entry.main([]) == entry.main(["dmo"]) == 2 and not asked.commands
    assert "python run.py demo" in capsys.readouterr().err


def test_both_entries_take_an_environment_for_ready_that_the_other_made(entry: ModuleType, asked: Asked) -> None:
    entry.main(["setup"])
    for name, content in (("packages.sha256", (entry.TOP / "requirements.lock").read_bytes()),
                          ("project.sha256", f"{entry.TOP}\n".encode() + (entry.TOP / "pyproject.toml").read_bytes())):  # fmt: skip
        if sys.platform == "linux":
            by_shell = subprocess.Popen(["sha256sum"], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
            told = by_shell.communicate(content)[0].decode().split()[0]
            assert (entry.VENV / name).read_text().split()[0] == told
    (entry.VENV / "packages.sha256").write_text(
        (entry.VENV / "packages.sha256").read_text() + "  -\n"
    )  # as ./run writes it
    entry.main(["setup"])
    assert asked.count("venv") == 1


def test_run_cmd_calls_it_with_windows_line_ends() -> None:
    text = (TOP / "run.cmd").read_bytes()
    assert text.count(b"run.py") >= 2 and text.count(b"\r\n") == text.count(b"\n") and b"exit /b %errorlevel%" in text


def test_run_cmd_has_no_block_that_a_bracket_in_a_path_would_end() -> None:
    """cmd.exe puts %~dp0 and %* into a block before it looks for the block's end: C:\\Program Files (x86) would be it."""
    assert not re.search(r"\([^\r\n]*%(~dp0|\*)", (TOP / "run.cmd").read_text())


@pytest.mark.skipif(os.name == "nt", reason="sends SIGINT to a group")
@pytest.mark.parametrize(("command", "line"), [("palpate", "cancelled"), ("setup", "run: cancelled")])
def test_ctrl_c_is_one_line_and_130(tmp_path: Path, command: str, line: str) -> None:
    top = tmp_path / "project"
    python = top / ".venv" / "bin" / "python"
    python.parent.mkdir(parents=True)
    for name in ("requirements.lock", "pyproject.toml"):
        (top / name).write_text("one\n")
    shutil.copy(TOP / "run.py", top)
    # The program hears Ctrl-C, takes its time to end, and says so; pip would not be quiet about it.
    told = "echo cancelled >&2" if command == "palpate" else "echo Traceback >&2"
    python.write_text(f"#!/bin/sh\ntrap 'sleep 0.5; {told}; exit 130' INT\necho ready\nsleep 20 & wait $!\n")
    python.chmod(0o755)
    noted = hashlib.sha256((top / "requirements.lock").read_bytes()).hexdigest()
    (top / ".venv" / "packages.sha256").write_text(noted)
    if command == "palpate":
        project = hashlib.sha256(f"{top}\n".encode() + (top / "pyproject.toml").read_bytes()).hexdigest()
        (top / ".venv" / "project.sha256").write_text(project)
    process = subprocess.Popen(
        [sys.executable, str(top / "run.py"), command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL) and None,
    )  # fmt: skip
    assert process.stdout is not None and process.stdout.readline() == "ready\n"
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert len(err.splitlines()) == 1 and err.startswith(line), err
