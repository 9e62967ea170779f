"""The window's logic without a window: opening, correcting, running in the worker, cancelling, and coming back after a kill."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from phantoms import CENTRE, MARKER, result, write_case

from palpate.core.errors import InputError
from palpate.core.worker.job import Job
from palpate.ui.cli.signals import descendants
from palpate.ui.desktop import commands, steps
from palpate.ui.desktop.controller import Controller
from palpate.ui.desktop.display import Display
from palpate.ui.desktop.dropping import Pair, case_beside
from palpate.ui.desktop.jobs import JobControl
from palpate.ui.desktop.open_case import GapMap, OpenCase
from palpate.ui.desktop.recent import recent_cases, remember
from palpate.ui.desktop.script import Driver, parse
from palpate.ui.pictures.planes import AXIAL

ORGAN = (float(CENTRE[0]) + 6.0, float(CENTRE[1]), float(CENTRE[2]))
EVERYTHING = frozenset(step.command for step in steps.STEPS)


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
        lambda: not (controller.reader.running or controller.jobs.running or controller.freshness.running),
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
    assert controller.value_at_crosshair() == "0 HU, prostate left, G = 120 kPa"

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


def test_time_left_follows_the_step(tmp_path: Path) -> None:
    jobs = JobControl()
    jobs.start(Job("palpate.core.worker.selfcheck:run", str(tmp_path), options={"iterations": 2, "accept": 1e9}), "x")
    state = jobs.state
    assert state is not None
    state.step_began, state.step_fraction = 100.0, 0.25
    assert state.seconds_left(103.0) is None
    assert state.seconds_left(110.0) == pytest.approx(30.0)
    jobs.cancel()
    jobs.wait(5.0)


def test_steps_tell_what_is_next_and_what_is_out_of_date(tmp_path: Path) -> None:
    judged: dict[str, str] = {}

    def states(edited: bool = False) -> dict[str, str]:
        return {s.step.command: s.state for s in steps.step_states(tmp_path, EVERYTHING, edited, judged)}

    assert [s.state for s in steps.step_states(None, EVERYTHING)] == [steps.READY] + [steps.BLOCKED] * 5
    (tmp_path / "report").mkdir()
    (tmp_path / "case.json").touch()
    assert states() == {"import": "done", "segment": "ready", "mesh": "blocked", "identify": "blocked",
                        "diagnose": "blocked", "report": "blocked"}  # fmt: skip
    for name in ("rest.nii.gz", "deformed.nii.gz", "mesh.npz", "surfaces.npz", "mesh.json", "result.json"):
        (tmp_path / name).touch()
    assert (states()["segment"], states()["mesh"], states()["report"]) == ("done", "checking", "ready")
    judged |= {"mesh": "", "identify": ""}
    assert states() | {} == {"import": "done", "segment": "done", "mesh": "done", "identify": "done",
                             "diagnose": "ready", "report": "ready"}  # fmt: skip
    (tmp_path / "report/report.html").touch()
    judged["report"] = ""
    found = steps.step_states(tmp_path, EVERYTHING, judged=judged)
    assert steps.next_step(found) is None and found[4].state == steps.READY
    assert states(edited=True)["mesh"] == states(edited=True)["report"] == "out of date"
    judged["mesh"] = "the labels have been changed since"
    after = steps.step_states(tmp_path, EVERYTHING, judged=judged)
    assert steps.next_step(after).step.command == "mesh"  # type: ignore[union-attr]
    assert after[2].reason == "the labels have been changed since" and after[5].state == steps.OUT_OF_DATE
    without = steps.step_states(tmp_path, EVERYTHING - {"diagnose"}, judged=judged)
    assert without[4].reason == "this version of Palpate has no such command"


def test_seeds_of_the_deformed_scan_are_told_in_its_own_coordinates() -> None:
    turn = np.array([[0.0, -1.0, 0.0, 5.0], [1.0, 0.0, 0.0, -3.0], [0.0, 0.0, 1.0, 2.0], [0.0, 0.0, 0.0, 1.0]])
    own = np.array([10.0, 20.0, 30.0])
    at_rest = turn[:3, :3] @ own + turn[:3, 3]
    seeds = {"rest": {"prostate": [-1.0, 2.0, 3.0]}, "deformed": {"rectum": at_rest.tolist()}}
    made = commands.step_command("segment", Path("/c"), seeds, turn)
    assert made == ["segment", "/c", "--seed", "prostate=-1.000,2.000,3.000", "--deformed-seed",
                    "rectum=10.000,20.000,30.000"]  # fmt: skip
    assert commands.step_command("mesh", Path("/c"), seeds, turn) == ["mesh", "/c"]


def test_dropped_folders_find_their_places(tmp_path: Path) -> None:
    for name in ("full_rectum", "empty", "third"):
        (tmp_path / name).mkdir()
    pair = Pair()
    assert pair.take([tmp_path / "full_rectum", tmp_path / "empty"]) is None
    assert (pair.rest, pair.deformed) == (tmp_path / "empty", tmp_path / "full_rectum") and not pair.why_not()
    assert pair.case == case_beside(tmp_path / "empty") and "empty" not in pair.case.name
    one_by_one = Pair()
    one_by_one.take([tmp_path / "third"])
    assert one_by_one.why_not() == "choose both scans first"
    one_by_one.take([tmp_path / "empty"])
    assert (one_by_one.rest, one_by_one.deformed) == (tmp_path / "third", tmp_path / "empty")
    for name in ("full.nii.gz", "empty.nii.gz"):
        (tmp_path / name).touch()
    pair.take([tmp_path / "full.nii.gz", tmp_path / "empty.nii.gz"])
    assert (pair.rest_labels, pair.deformed_labels) == (tmp_path / "empty.nii.gz", tmp_path / "full.nii.gz")
    assert pair.rest == tmp_path / "empty", "contours do not take the place of a scan"
    alone = Pair()
    alone.take([tmp_path / "full.nii.gz", tmp_path / "empty.nii.gz"])
    assert (alone.rest, alone.rest_labels) == (tmp_path / "empty.nii.gz", None)
    case = write_case(tmp_path / "case", result())
    assert pair.take([case.path]) == case.path
    pair.case = tmp_path
    assert pair.why_not() == f"{tmp_path} is not empty; choose a new folder for the case"


def test_recent_cases_are_those_that_are_still_there(tmp_path: Path) -> None:
    one, two = write_case(tmp_path / "one").path, write_case(tmp_path / "two").path
    for path in (one, two, one, tmp_path / "gone"):
        remember(path)
    assert recent_cases() == [one, two]
    (tmp_path / "settings" / "recent.json").write_text("{broken")
    assert recent_cases() == []


def test_a_display_of_another_version_is_taken_as_far_as_it_goes() -> None:
    shown = Display.from_dict(Display(mode="blend", opacity=0.9, tool="brush").to_dict() | {"new": 1})
    assert (shown.mode, shown.opacity, shown.tool) == ("blend", 0.9, "look")
    assert Display.from_dict({"mode": "upside down"}).mode == "rest"


@pytest.mark.parametrize(
    "text, said",
    [
        ("fly away", "line 1: no command 'fly'; give one of brush, cancel"),
        ("\n# x\nopen 'a", "line 3: No closing quotation"),
    ],
)
def test_a_script_that_cannot_be_understood_is_refused_before_it_starts(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        parse(text, "s.txt")


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


def test_the_map_of_a_diagnosis_is_shown_before_the_plain_misfit(tmp_path: Path) -> None:
    folder = tmp_path / "case"
    case = write_case(folder)
    spots, plain, found = np.arange(12.0).reshape(4, 3), np.full(4, 0.5), np.array([1.0, -2.0, 0.25, 0.0])
    case.write_npz("identify/fields.npz", surface_points=spots, surface_residual=plain)
    gap = _gap_of(folder)
    assert gap is not None
    assert not gap.diagnosed
    np.testing.assert_array_equal(gap.residual, plain)
    # The names that palpate.core.gap.record.maps gives.
    case.write_npz("diagnose/gap_maps.npz", points=spots + 1.0, residual_mm=found, standardised=found / 0.4)
    said = {"verdict": "none", "gap": {"rms_mm": 0.3, "noise_floor_mm": 0.4, "p_value": 0.5}, "candidates": []}
    case.write_json("diagnosis.json", {**said, "where": {"map": "diagnose/gap_maps.npz"}})
    gap = _gap_of(folder)
    assert gap is not None
    assert gap.diagnosed
    np.testing.assert_array_equal(gap.points, spots + 1.0)
    np.testing.assert_array_equal(gap.residual, found)


def test_the_map_says_where_it_tells_nothing(controller: Controller, tmp_path: Path) -> None:
    case = write_case(tmp_path / "case")
    centres = np.array([ORGAN, ORGAN]) + [[3.0, 0.0, 0.0], [3.0, 0.0, 9.0]]
    case.write_npz("identify/stiffness_map.npz", centres=centres, ln_G=np.log([60.0, 60.0]), sd=np.array([0.1, 0.1]),
                   told=np.array([True, False]), prior=np.array([np.log(60.0), 0.5, 0.5, 8.0]), weights=np.zeros(2))  # fmt: skip
    case.write_json("result.json", result(stiffness_map={"patches": 2}))
    controller.open_case(case.path)
    wait(controller)
    controller.show(overlay="map", crosshair=ORGAN)
    assert controller.value_at_crosshair() == "prostate left, G here = 60 kPa"
    controller.show(surest_factor=1.1)
    assert controller.value_at_crosshair() == "prostate left, the map does not tell G here"
    controller.show(surest_factor=None, crosshair=(ORGAN[0], ORGAN[1], ORGAN[2] + 9.0))
    assert controller.value_at_crosshair() == "prostate left, the map does not tell G here"
    controller.show(mode="deformed")
    assert controller.value_at_crosshair() == "prostate left, G of the half = 120 kPa"


def test_a_stroke_puts_what_was_found_out_of_date_till_it_is_undone(controller: Controller, tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", result(inputs_sha256={}))
    for name in ("mesh.json", "report/report.html"):
        case.write_text(name, "{}")
    controller.open_case(case.path)
    wait(controller)
    controller.look_at(*ORGAN)
    assert not controller.out_of_date("identify") and not controller.out_of_date("report")
    assert controller.value_at_crosshair() == "prostate left, G = 120 kPa"
    paint(controller, 5, (ORGAN[0], ORGAN[1] + 8.0, ORGAN[2]))
    assert controller.out_of_date("identify") == controller.out_of_date("report")
    assert controller.out_of_date("identify") == "an earlier step has been changed since"
    assert controller.value_at_crosshair() == "prostate left, G = 120 kPa, out of date"
    controller.editing.undo()
    assert not controller.out_of_date("identify") and not controller.out_of_date("diagnose")


def _gap_of(folder: Path) -> GapMap | None:
    opened = OpenCase(folder)
    try:
        return opened.gap
    finally:
        opened.close()


def test_contours_go_to_the_import(tmp_path: Path) -> None:
    a, b, case = tmp_path / "a", tmp_path / "b", tmp_path / "case"
    command = commands.import_command(a, b, case, (None, tmp_path / "rs.dcm"))
    assert command[-2:] == ["--deformed-labels", str(tmp_path / "rs.dcm")] and "--rest-labels" not in command
