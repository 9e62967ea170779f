"""The sample from the first page: one press runs all of it, and what has been finished is opened at once."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest
from phantoms import write_case

from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.jobs import JobState
from palpate.ui.desktop.session.opening import ScanPair
from palpate.ui.desktop.session.sample import STEPS, finished_sample, sample_pair


def test_the_sample_is_run_in_a_folder_of_its_own_and_found_when_finished(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    rest, deformed, case = sample_pair()
    assert rest.is_dir() and deformed.is_dir() and case == tmp_path / "palpate" / "sample" / "case_01"
    case.mkdir(parents=True)
    assert finished_sample() is None, "begun is not finished"
    for number, age in ((1, 50), (2, 10), (3, 30)):
        report = case.with_name(f"case_0{number}") / "report" / "report.html"
        report.parent.mkdir(parents=True)
        report.write_text("a report")
        os.utime(report, (time.time() - age,) * 2)
    assert finished_sample() == case.with_name("case_02"), "the last one"


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
