"""Parts of the window's logic by themselves: steps, seeds, what was dropped, recent cases, scripts, the map that is shown."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from diagnoses import diagnosis
from phantoms import result, write_case

from palpate.applications.touch.window import touch_script as script
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.core.errors import InputError
from palpate.core.worker.job import Job
from palpate.ui.desktop.panels.job_panel import time_words
from palpate.ui.desktop.scripting.commands_script import Driver, parse
from palpate.ui.desktop.scripting.script_runner import names_of
from palpate.ui.desktop.session import steps
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.display import Display
from palpate.ui.desktop.session.dropped_files import Pair, case_beside
from palpate.ui.desktop.session.jobs import JobControl, JobState
from palpate.ui.desktop.session.open_case import GapMap, OpenCase
from palpate.ui.desktop.session.recent import recent_cases, remember
from palpate.ui.desktop.session.step_requests import StepRequest, import_request, step_request
from palpate.ui.desktop.window import menu
from palpate.ui.desktop.window.notices import Notices
from palpate.ui.export import names

EVERYTHING = frozenset(step.command for step in steps.STEPS)


@pytest.fixture(autouse=True)
def _own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))


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


def test_time_left_that_was_told_never_grows_and_elapsed_stands_beside_it() -> None:
    state = JobState("x", 100.0, step_began=100.0, step_fraction=0.5)
    assert state.seconds_left(110.0) == pytest.approx(10.0)
    told = [state.seconds_left(now) for now in (112.0, 118.0, 125.0, 400.0)]  # the step stands still
    assert told == pytest.approx([8.0, 2.0, 0.0, 0.0])
    assert time_words(25.0, 0.0, False) == "25 s so far, longer than was thought"
    assert time_words(200.0, 130.0, False) == "3 min so far, about 2 min left"
    assert time_words(2.0, None, False) == "5 s so far" and time_words(61.0, None, True) == "took 60 s"


@pytest.mark.parametrize(
    "seconds, outcome, error, words",
    [(200.0, "done", "", ["Stiffness: done"]), (3.0, "done", "", []), (200.0, "cancelled", "", []),
     (30.0, "failed", "no equilibrium", ["Stiffness: failed, no equilibrium"])],
)  # fmt: skip
def test_a_long_step_that_ends_is_told_once(seconds: float, outcome: str, error: str, words: list[str]) -> None:
    told: list[str] = []
    controller = Controller()
    notices = Notices(controller, told.append)
    controller.jobs.state = JobState("x", 0.0, step="identify")
    notices.on_change("job")
    assert not told
    controller.jobs.state = JobState("x", 0.0, step="identify", outcome=outcome, error=error, seconds_taken=seconds)
    for what in ("view", "job", "job"):
        notices.on_change(what)
    assert told == words


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
    made = step_request("segment", Path("/c"), seeds, turn)
    assert made.typed == "CASE --seed prostate=-1.000,2.000,3.000 --deformed-seed rectum=10.000,20.000,30.000"
    assert made.options.prompts_deformed.to_dict()["seeds"] == {"rectum": [10.0, 20.0, 30.0]}
    assert step_request("mesh", Path("/c"), seeds, turn).to_dict() == {
        "step": "mesh", "case": "/c", "options": None, "typed": "CASE", "scans": None,
    }  # fmt: skip


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


def test_the_map_of_a_diagnosis_is_shown_before_the_plain_misfit(tmp_path: Path) -> None:
    folder = tmp_path / "case"
    case = write_case(folder)
    spots, plain, found = np.arange(12.0).reshape(4, 3), np.full(4, 0.5), np.array([1.0, -2.0, 0.25, 0.0])
    case.write_npz("identify/fields.npz", surface_points=spots, surface_residual=plain)
    gap = _gap_of(folder)
    assert gap is not None
    assert not gap.diagnosed
    np.testing.assert_array_equal(gap.residual, plain)
    # The names that palpate.core.diagnose.verdict.record.maps gives.
    missed = np.array([[0.3, -0.6, 0.0]])
    around = {"motion/places": spots[:1], "motion/residual_mm": missed, "motion/standardised": missed / 0.2}
    case.write_npz("diagnose/gap_maps.npz", points=spots + 1.0, residual_mm=found, standardised=found / 0.4, **around)
    case.write_json("diagnosis.json", diagnosis("none"))
    gap = _gap_of(folder)
    assert gap is not None
    assert gap.diagnosed
    np.testing.assert_array_equal(gap.points, spots + 1.0)
    np.testing.assert_array_equal(gap.residual, found)
    np.testing.assert_array_equal(gap.missed, missed)
    np.testing.assert_allclose(gap.missed_sd, np.sqrt((1.5**2 + 3.0**2) / 3.0))


def _gap_of(folder: Path) -> GapMap | None:
    opened = OpenCase(folder)
    try:
        return opened.gap
    finally:
        opened.close()


def test_contours_go_to_the_import(tmp_path: Path) -> None:
    a, b, case = tmp_path / "a", tmp_path / "b", tmp_path / "case"
    request = StepRequest.from_dict(import_request(a, b, case, (None, tmp_path / "rs.dcm")).to_dict())
    assert request.options == ImportOptions(labels=(None, tmp_path / "rs.dcm")) and request.scans == (a, b)
    assert request.typed == "REST DEFORMED -o CASE --deformed-labels FILE"


def test_the_menu_has_words_for_every_form_of_the_export() -> None:
    assert set(menu.FORMS) == set(names())


def test_the_pages_tell_every_command_and_every_field_of_the_display() -> None:
    docs = Path(__file__).parents[3] / "docs"
    told = set(re.findall(r"`([a-z]+)[ `]", (docs / "desktop.md").read_text(encoding="utf-8")))
    assert names_of(Driver) <= told, names_of(Driver) - told
    felt = set(re.findall(r"`([a-z]+)[ `]", (docs / "touch.md").read_text(encoding="utf-8")))
    assert names_of(script.Driver) | script.OF_THE_WINDOW <= felt
    page = (docs / "desktop.md").read_text(encoding="utf-8")
    assert all(f"`{field.name}`" in page for field in fields(Display) if field.name != "crosshair")
