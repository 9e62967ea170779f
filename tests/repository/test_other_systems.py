"""What stands in the way on Windows and macOS: no module of the main job needs what only Linux or a POSIX system has."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from rooms import PACKAGES

from palpate.core.errors import InputError
from palpate.core.files import atomic
from palpate.ui.cli import signals
from palpate.ui.desktop.session import open_case

TOP = Path(__file__).resolve().parents[2]
# Modules that Windows' Python does not have.
POSIX = ("fcntl", "grp", "pwd", "resource", "termios", "tty")
# Comparisons with programs that run on Linux only.
BENCH = "validate/bench/"

IMPORTS = f"""
import sys
for name in {POSIX!r}:
    sys.modules[name] = None
import palpate.ui.cli.main
from palpate.ui.cli.main import COMMANDS, command_module
import importlib
for name in COMMANDS:
    command_module(name)
for name in ("import_scans.pair", "segment", "mesh", "identify", "diagnose", "plan"):
    importlib.import_module("palpate.case.steps." + name)
for name in ("applications.touch.case_body", "applications.drop.fall", "applications.organ_pages"):
    importlib.import_module("palpate." + name)
for name in ("ui.report.report_step", "ui.desktop.window.main_window", "ui.desktop.scripting.play", "ui.desktop.solid.pipe_child"):
    importlib.import_module("palpate." + name)
"""


def sources() -> list[Path]:
    return [path for room in PACKAGES for path in (TOP / room).rglob("*.py")]


def test_every_step_and_the_window_are_imported_without_posix_modules() -> None:
    done = subprocess.run([sys.executable, "-c", IMPORTS], capture_output=True, text=True, check=False,
                          env=os.environ | {"QT_QPA_PLATFORM": "offscreen"})  # fmt: skip
    assert done.returncode == 0, done.stderr[-1500:]


def test_what_only_linux_has_is_asked_for_behind_a_question() -> None:
    """Every file that names one of these asks which system it is on, or whether it is there."""
    only = re.compile(
        r"/proc/|os\.killpg|os\.fork\b|os\.nice|os\.set_blocking|sched_getaffinity|prctl|import fcntl|select\.select"
    )
    asks = re.compile(r"sys\.platform|hasattr\(os,|\.exists\(\)|except ImportError")
    for path in sources():
        text, name = path.read_text(encoding="utf-8"), path.relative_to(TOP).as_posix()
        if only.search(text) and not name.startswith(BENCH):
            assert asks.search(text), name


def test_on_windows_nobody_is_sent_a_signal_to_see_whether_he_lives(monkeypatch: pytest.MonkeyPatch) -> None:
    """There, signal 0 is Ctrl-C."""
    monkeypatch.setattr(sys, "platform", "win32")

    def sent(process: int, number: int) -> None:
        raise AssertionError("a signal was sent")

    monkeypatch.setattr(os, "kill", sent)
    assert atomic._is_another_running(4711) and not atomic._is_another_running(os.getpid())
    assert signals.descendants(os.getpid()) == []


def test_on_windows_a_case_that_is_open_twice_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    held: list[int] = []

    def locking(descriptor: int, mode: int, count: int) -> None:
        if held:
            raise PermissionError(13, "Permission denied")
        held.append(descriptor)

    played = SimpleNamespace(locking=locking, LK_NBLCK=2)
    monkeypatch.setitem(sys.modules, "msvcrt", played)  # type: ignore[arg-type]
    monkeypatch.setattr(sys, "platform", "win32")
    open_case._locked(tmp_path / "desktop" / "lock")
    with pytest.raises(InputError, match="open in another window"):
        open_case._locked(tmp_path / "desktop" / "lock")
