"""The window's logic without a window: opening, correcting, running in the worker, cancelling, and coming back after a
kill.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from phantoms import CENTRE, MARKER, map_facts, result, write_case

from palpate.core.errors import InputError
from palpate.core.worker.job import Job
from palpate.ui.cli.signals import descendants
from palpate.ui.desktop.scripting.commands_script import Driver
from palpate.ui.desktop.session import steps
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.crosshair import words_at_crosshair
from palpate.ui.desktop.session.jobs import JobControl
from palpate.ui.pictures.planes import AXIAL

ORGAN = (float(CENTRE[0]) + 6.0, float(CENTRE[1]), float(CENTRE[2]))


@pytest.fixture(autouse=True)
def _own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))


@pytest.fixture
def controller() -> Iterator[Controller]:
    made = Controller()
    yield made
    made.quit()


def wait(controller: Controller, seconds: float = 60.0) -> None:
    until(
        controller,
        lambda: not (controller.reader.running or controller.jobs.running or controller.out_of_date_check.running),
        seconds,
    )


def until(controller: Controller, done: Callable[[], bool], seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, "it did not come to its end"
        controller.poll()
        time.sleep(0.01)


def paint(controller: Controller, label: int, at: tuple[float, float, float], tool: str = "brush") -> None:
    controller.show(tool=tool, label=label, radius_mm=5.0)
    controller.editing.begin("rest", AXIAL, at)
    controller.editing.go_on(AXIAL, (at[0] + 4.0, at[1], at[2]))
    controller.editing.end()


def test_a_case_from_opening_to_coming_back_after_a_kill(controller: Controller, tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", ct=True)
    controller.open_case(case.path)
    assert controller.editing.why_not() == "the labels are being read"
    wait(controller)
    ct = controller.ct("rest")
    assert ct is not None and not isinstance(ct.array.base, type(None))  # mapped, not read
    assert ct.array[tuple(np.rint(ct.to_index(MARKER[None])[0]).astype(int))] == 1000
    assert controller.display.overlay == "stiffness"
    controller.look_at(*ORGAN)
    assert words_at_crosshair(controller) == "0 HU, prostate left, G = 120 kPa (95 % 100\N{EN DASH}144)"

    before = controller.labels("rest").array.copy()  # type: ignore[union-attr]
    controller.editing.seed("rest", "prostate", ORGAN)
    paint(controller, 5, ORGAN)
    painted = controller.labels("rest").array.copy()  # type: ignore[union-attr]
    assert (painted == 5).sum() > 10 and controller.case is not None and controller.case.corrections.unsaved
    assert case.labels("rest").array[before == 1].min() == 1  # nothing is written into the labels yet
    assert [s.state for s in controller.steps() if s.step.command == "identify"] == [steps.BLOCKED]
    controller.case.flush()
    os.close(controller.case._lock)  # type: ignore[arg-type]  # what the system does for a process that was killed
    controller.case._lock = None

    second = Controller()
    second.open_case(case.path)
    wait(second)
    assert np.array_equal(second.labels("rest").array, painted)  # type: ignore[union-attr]
    assert second.case is not None and second.case.corrections.unsaved and "had not been saved" in second.said
    assert second.case.seeds["rest"]["prostate"] == pytest.approx(list(ORGAN))
    assert second.editing.undo() and np.array_equal(second.labels("rest").array, before)  # type: ignore[union-attr]
    assert second.editing.redo()
    second.save()
    second.case.flush()
    assert np.array_equal(case.labels("rest").array, painted) and not second.case.corrections.unsaved
    with pytest.raises(InputError, match="is open in another window"):
        Controller().open_case(case.path)
    second.quit()


def test_a_step_runs_in_the_worker_and_its_result_is_taken_in(controller: Controller, tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    case.file("result.json").unlink()
    controller.open_case(case.path)
    wait(controller)
    paint(controller, 1, ORGAN, tool="eraser")
    erased = controller.labels("rest").array.copy()  # type: ignore[union-attr]
    told = []
    controller.listeners.append(told.append)
    controller.run("segment")  # labels that came with the case are kept as they are
    assert "a step runs" in controller.editing.why_not()
    with pytest.raises(InputError, match="another step runs"):
        controller.run("mesh")
    wait(controller)
    state = controller.jobs.state
    assert state is not None and (state.outcome, state.fraction, state.error) == ("done", 1.0, "")
    assert "job" in told and np.array_equal(case.labels("rest").array, erased)  # saved before the step ran
    assert controller.case is not None and controller.case.corrections.can_undo
    assert case.has("desktop/rest_corrected.nii.gz")
    assert case.read_json("history.json")["commands"][-1]["command"] == "segment"


def test_a_step_that_fails_says_why_and_names_no_step_that_is_not_there(controller: Controller, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no case is open"):
        controller.run("mesh")
    case = write_case(tmp_path / "case")
    controller.open_case(case.path)
    wait(controller)
    with pytest.raises(InputError, match="no step 'fly'"):
        controller.run("fly")
    case.file("result.json").write_text("{")
    controller.run("report")
    wait(controller)
    assert controller.jobs.state is not None and controller.jobs.state.outcome == "failed"
    assert "result.json is not valid JSON" in controller.said


def test_scans_that_cannot_be_read_are_refused_in_words(controller: Controller, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="none is not there; choose the folder"):
        controller.open_pair(tmp_path / "none", tmp_path, tmp_path / "case")
    (tmp_path / "a").mkdir()
    controller.open_pair(tmp_path / "a", tmp_path / "a", tmp_path / "case")
    wait(controller)
    assert controller.case is None and str(tmp_path / "a") in controller.said
    assert not (tmp_path / "case").exists()


def test_cancel_within_a_second_and_no_process_left(tmp_path: Path) -> None:
    jobs = JobControl()
    before = set(descendants(os.getpid()))
    options = {"iterations": 5000, "pause_s": 0.002, "accept": 1e9}
    jobs.start(Job("palpate.core.worker.selfcheck:run", str(tmp_path), options=options, workers=2), "Swarm")
    end = time.monotonic() + 60.0
    while len(jobs.state.swarm.iterations) < 3:  # type: ignore[union-attr]
        assert time.monotonic() < end
        jobs.poll()
        time.sleep(0.01)
    assert len(set(descendants(os.getpid())) - before) >= 2
    jobs.cancel()
    asked = time.monotonic()
    while jobs.running:
        jobs.poll()
        time.sleep(0.005)
    left = set(descendants(os.getpid())) - before
    assert not left and time.monotonic() - asked < 1.0
    state = jobs.state
    assert state is not None and state.outcome == "cancelled" and state.cancel_seconds is not None
    swarm = state.swarm
    assert len(swarm.particles[0]) == 2 and swarm.best == sorted(swarm.best, reverse=True)


def test_a_script_expects_facts_by_their_names_and_values(controller: Controller, tmp_path: Path) -> None:
    controller.open_case(write_case(tmp_path / "case").path)
    wait(controller)
    driver = Driver(SimpleNamespace(controller=controller), lambda seconds: None, tmp_path, "s.txt")
    for name, value in (("case", "true"), ("labels", "deformed,rest"), ("cancel_seconds", "none"), ("said", ""),
                        ("seeds", "0"), ("job", "none"), ("simulated", "false"), ("steps.segment", "Done")):  # fmt: skip
        driver.do_expect(name, value)
    with pytest.raises(InputError, match="labels is deformed,rest, not rest"):
        driver.do_expect("labels", "rest")
    for name in ("unsafed", "steps", "steps.fly", "case.open"):
        with pytest.raises(InputError, match=f"no fact '{name}'; give one of case, unsaved, .*steps.report"):
            driver.do_expect(name, "true")


def test_the_map_says_where_it_tells_nothing(controller: Controller, tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    centres = np.array([ORGAN, ORGAN]) + [[3.0, 0.0, 0.0], [3.0, 0.0, 9.0]]
    case.write_npz("identify/stiffness_map.npz", centres=centres, ln_G=np.log([60.0, 60.0]), sd=np.array([0.1, 0.1]),
                   told=np.array([True, False]), prior=np.array([np.log(60.0), 0.5, 0.5, 8.0]), weights=np.zeros(2))  # fmt: skip
    case.write_json("result.json", result(stiffness_map=map_facts()))
    controller.open_case(case.path)
    wait(controller)
    controller.show(overlay="map", crosshair=ORGAN)
    assert words_at_crosshair(controller) == (
        "prostate left, G here = 60.0 kPa (95 % 49.3\N{EN DASH}73.0), E = 180 kPa, quote the half: 120 kPa (95 % 100\N{EN DASH}144)"
    )
    opened = controller.case
    assert opened is not None and opened.stiffness_map is not None
    controller.show(surest_factor=1.1)
    assert words_at_crosshair(controller) == "prostate left, the map does not determine G here"
    controller.show(surest_factor=None, crosshair=(ORGAN[0], ORGAN[1], ORGAN[2] + 9.0))
    assert words_at_crosshair(controller) == "prostate left, the map does not determine G here"
    controller.show(mode="deformed")
    assert words_at_crosshair(controller) == "prostate left, G of the half = 120 kPa (95 % 100\N{EN DASH}144)"


def test_a_stroke_puts_what_was_found_out_of_date_till_it_is_undone(controller: Controller, tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", result(inputs_sha256={}))
    for name in ("mesh.json", "report/report.html"):
        case.write_text(name, "{}")
    controller.open_case(case.path)
    wait(controller)
    controller.look_at(*ORGAN)
    assert not controller.out_of_date("identify") and not controller.out_of_date("report")
    assert words_at_crosshair(controller) == "prostate left, G = 120 kPa (95 % 100\N{EN DASH}144)"
    paint(controller, 5, (ORGAN[0], ORGAN[1] + 8.0, ORGAN[2]))
    assert controller.out_of_date("identify") == controller.out_of_date("report")
    assert controller.out_of_date("identify") == "an earlier step has been changed since"
    assert words_at_crosshair(controller) == "prostate left, G = 120 kPa (95 % 100\N{EN DASH}144), out of date"
    controller.editing.undo()
    assert not controller.out_of_date("identify") and not controller.out_of_date("diagnose")
