"""The sample from the first page: one press opens the finished one, another runs all of it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from phantoms import write_case
from x_display import needs_xvfb, x_display

from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.jobs import JobState
from palpate.ui.desktop.session.opening import ScanPair
from palpate.ui.desktop.session.sample import STEPS, finished_sample, sample_pair


def test_the_sample_is_run_in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    rest, deformed, case = sample_pair()
    assert rest.is_dir() and deformed.is_dir() and case == tmp_path / "palpate" / "sample" / "case_01"
    case.mkdir(parents=True)
    assert sample_pair()[2] == case.with_name("case_02"), "none of before is written over"


def test_the_finished_sample_of_before_is_opened_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    folder = finished_sample()
    assert folder.is_relative_to(tmp_path / "palpate" / "sample")
    (folder / "measurements.json").write_text("[]")
    assert finished_sample() == folder and (folder / "measurements.json").read_text() == "[]"


OPENED = """
    resize 1280 700
    press Open the finished sample
    pause 10
    expect steps.segment done
    expect steps.mesh done
    expect steps.identify done
    expect steps.diagnose done
    expect simulated true
    show overlay map
    screenshot opened.png
    cancel
    quit
"""


@needs_xvfb
def test_a_press_opens_it_done_and_draws_its_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the real window. Nothing is out of date; the drawing of the report is cancelled here."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))
    (tmp_path / "script.txt").write_text(OPENED)
    with x_display(tmp_path, "1280x720", monkeypatch):
        done = subprocess.run(
            [sys.executable, "-m", "palpate.ui.cli", "open", "--script", str(tmp_path / "script.txt"), "--json"],
            capture_output=True, text=True, check=False, timeout=300,
        )  # fmt: skip
    if "no window can be opened" in done.stdout:
        pytest.skip("Qt's X11 libraries are not on this machine")
    assert done.returncode == 0, done.stdout[-1500:] + done.stderr[-500:]
    assert (tmp_path / "opened.png").stat().st_size > 100_000
    told = json.loads(done.stdout)["events"]
    assert told[-2]["labels"] == ["deformed", "rest"] and told[-2]["steps"]["report"] in ("ready", "done")


def test_the_report_is_drawn_once_the_scans_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not beside the reading, which a person waits for, and not where the person has started another step."""
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))
    controller, started = Controller(), list[tuple[str, ...]]()
    monkeypatch.setattr(controller._running, "start", started.append)
    try:
        for running, expected in ((False, [("report",)]), (True, [])):
            case = write_case(tmp_path / f"case_{running}")
            started.clear()
            controller.open_case(case.path, then=("report",))
            assert started == []
            monkeypatch.setattr(type(controller.jobs), "running", running)
            for _ in range(2):
                controller.reader.state = JobState("Reading", 0.0, outcome="done")
                controller._opening.told()
            assert started == expected
            monkeypatch.undo() if running else monkeypatch.setattr(type(controller.jobs), "running", False)
    finally:
        controller.quit()


def test_the_steps_follow_the_import_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The import is played: its case is there, and its job has ended."""
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))
    controller, started = Controller(), list[tuple[str, ...]]()
    monkeypatch.setattr(controller._running, "start", started.append)
    try:
        case = write_case(tmp_path / "case")
        controller._opening.pair = ScanPair(tmp_path, tmp_path, case.path, (None, None), then=STEPS)
        controller.jobs.state = JobState("Open", 0.0, outcome="done")
        for _ in range(2):
            controller._running._ended("done", "")
        assert controller.case is not None and started == [STEPS]
    finally:
        controller.quit()
