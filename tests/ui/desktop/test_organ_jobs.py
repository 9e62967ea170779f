"""Touch and fall of the organ from the window: what they make, what is said of them, and what they refuse."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import pytest
from films import read_film
from phantoms import result, write_case

from palpate.applications import organ_jobs as make_organ
from palpate.applications.dynamics.drop import DropOptions
from palpate.applications.touch.body_file import load_body
from palpate.core.errors import InputError
from palpate.core.fem.meshes import box, with_regions
from palpate.core.worker.messages import Message, Reporter
from palpate.ui.desktop.session import beside_jobs
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.jobs import JobState


@pytest.fixture(autouse=True)
def _own_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PALPATE_SETTINGS", str(tmp_path / "settings"))
    monkeypatch.setattr(make_organ, "give_way", lambda: None)  # the tests' own process stays as quick as it is


def opened(path: Path) -> Controller:
    controller = Controller()
    controller.open_case(path)
    until(controller, lambda: not controller.reader.running)
    return controller


def until(controller: Controller, done: object, seconds: float = 200.0) -> None:
    end = time.monotonic() + seconds
    while not done():  # type: ignore[operator]
        assert time.monotonic() < end, controller.said
        controller.poll()
        time.sleep(0.01)


def test_touch_is_told_from_the_first_moment_and_can_be_stopped(tmp_path: Path) -> None:
    controller = opened(write_case(tmp_path / "case", result()).path)
    told: list[str] = []
    controller.listeners.append(told.append)
    controller.touch()
    state = controller.jobs.state
    assert state is not None and state.title == "Touch" and told[-1] == "job", "there is something to see at once"
    with pytest.raises(InputError, match="another step runs"):
        controller.drop(tmp_path / "film.mp4")
    controller.cancel()
    until(controller, lambda: not controller.jobs.running)
    assert "cancelled" in controller.said and not controller.take_made()
    controller.quit()


def test_the_body_is_that_of_the_case_and_is_told_once(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", result())
    job = beside_jobs.body_job(case.path, tmp_path)
    job = replace(job, options={**job.options, "tets": 500})
    heard: list[Message] = []
    found = make_organ.make_body(job, Reporter(heard.append))
    body = load_body(Path(str(found["body"])))
    assert body.shear_kpa == {1: 120.0, 2: 40.0} and body.names[1] == "prostate_left" and heard
    controller = opened(case.path)
    controller.jobs.state = JobState("Touch", 0.0, outcome="done", result=found)
    controller._running.told()
    assert controller.take_made() == {"body": tmp_path / "body.npz"} and not controller.take_made()
    controller.quit()


def test_what_cannot_be_is_said_in_one_line(tmp_path: Path) -> None:
    controller = Controller()
    with pytest.raises(InputError, match="no case is open"):
        controller.touch()
    bare = write_case(tmp_path / "bare")
    bare.file("result.json").unlink()
    controller = opened(bare.path)
    for act in (controller.touch, lambda: controller.drop(tmp_path / "a.mp4")):
        with pytest.raises(InputError, match="no stiffness has been found yet; run Stiffness first"):
            act()
    controller.quit()
    controller = opened(write_case(tmp_path / "case", result()).path)
    with pytest.raises(InputError, match=r"a film is a file whose name ends in \.mp4"):
        controller.drop(tmp_path / "film.avi")
    controller.quit()
    with pytest.raises(InputError, match="run `palpate mesh` on the case first"):
        make_organ.make_film(beside_jobs.film_job(tmp_path / "case", tmp_path / "film.mp4", tmp_path), Reporter(print))


def test_the_film_is_made_and_tells_how_far_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    case = write_case(tmp_path / "case", result())
    mesh = with_regions(box((24.0, 16.0, 14.0), (2, 1, 1)), lambda c: 1 + (c[:, 0] < 12.0))
    case.write_npz("mesh.npz", points=mesh.points, cells=mesh.cells, regions=mesh.regions)
    monkeypatch.setattr(make_organ, "DropOptions", lambda frames: DropOptions(seconds=0.02, frames=frames))
    heard: list[Message] = []
    found = make_organ.make_film(
        beside_jobs.film_job(case.path, tmp_path / "fall.mp4", tmp_path), Reporter(heard.append)
    )
    assert found == {"film": str(tmp_path / "fall.mp4")} and len(read_film(tmp_path / "fall.mp4")) > 3
    fractions = [message["fraction"] for message in heard if message["type"] == "progress"]
    assert fractions == sorted(fractions) and len(fractions) > 4
