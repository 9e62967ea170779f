"""Search and diagnosis side by side: when the diagnosis starts, and what a failure of either leaves."""

from __future__ import annotations

import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.steps.diagnose import DiagnoseOptions
from palpate.core.errors import Cancelled, ConvergenceError
from palpate.core.identify.options import IdentifyOptions
from palpate.ui.cli import search_and_diagnosis
from palpate.ui.cli.console import Console
from palpate.ui.cli.search_and_diagnosis import search_and_diagnose

LONG_S = 20.0


class Steps:
    """Stand-ins of both steps, whose jobs are functions of this test. met : set when the diagnosis runs."""

    def __init__(self, patch: pytest.MonkeyPatch, folder: Path) -> None:
        self.folder = CaseFolder.create(folder / "case", CaseFacts("made-up")).path
        self.met, self.order = threading.Event(), list[str]()
        self.image: bool | None = None
        self.search: Callable[[Callable[[dict[str, object]], None]], object] = lambda tell: "stiffness"
        self.diagnosis: Callable[[threading.Event | None], object] = lambda stop: "gap"
        patch.setattr(search_and_diagnosis.identify, "run", self._identify)
        patch.setattr(search_and_diagnosis.diagnose, "run", self._diagnose)
        patch.setattr(search_and_diagnosis, "run_job", lambda job, tell, stop=None: job(tell, stop))

    def _identify(self, case, options, progress, do_job):
        found = do_job(lambda tell, _: self.search(tell), lambda message: None)
        self.order.append("searched")
        return found

    def _diagnose(self, case, options, progress, do_job):
        self.met.set()
        self.image = options.image
        found = do_job(lambda _, stop: self.diagnosis(stop), lambda message: None)
        self.order.append("diagnosed")
        return found

    def go(self, side_by_side: bool = True, image: bool | None = None):
        case = CaseFolder(self.folder)
        return search_and_diagnose(
            case, IdentifyOptions(image=image), DiagnoseOptions(), Console(quiet=True), side_by_side
        )


@pytest.fixture
def steps(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Steps:
    return Steps(monkeypatch, tmp_path)


def test_the_diagnosis_runs_while_the_search_goes_on_from_the_kept_fit(steps: Steps) -> None:
    def search(tell):
        assert not steps.met.wait(0.2), "there is no fit yet"
        tell({"type": "checkpoint", "path": "case/identify/plain_fit.npz", "iteration": 0})
        assert steps.met.wait(LONG_S)
        return "stiffness"

    steps.search = search
    assert steps.go() == ("stiffness", "gap")


def test_a_checkpoint_of_the_swarm_is_no_fit(steps: Steps) -> None:
    def search(tell):
        tell({"type": "checkpoint", "path": "case/identify/swarm.npz", "iteration": 1})
        assert not steps.met.wait(0.2)
        return "stiffness"

    steps.search = search
    assert steps.go() == ("stiffness", "gap")
    assert steps.order == ["searched", "diagnosed"], "a search that keeps no fit is waited for"


@pytest.mark.parametrize("failure", [ConvergenceError("no particle"), KeyboardInterrupt("stop")])
def test_a_search_that_fails_stops_the_diagnosis(steps: Steps, failure: BaseException) -> None:
    def search(tell):
        tell({"type": "checkpoint", "path": "plain_fit.npz", "iteration": 0})
        assert steps.met.wait(LONG_S)
        raise failure

    def diagnosis(stop):
        assert stop.wait(LONG_S), "nobody stopped it"
        raise Cancelled("stopped")

    steps.search, steps.diagnosis = search, diagnosis
    with pytest.raises(type(failure), match=str(failure)):
        steps.go()
    assert steps.order == []


@pytest.mark.parametrize("side_by_side", [True, False])
def test_a_case_that_cannot_be_diagnosed_keeps_its_stiffness(steps: Steps, side_by_side: bool) -> None:
    def diagnosis(stop):
        raise ConvergenceError("folded cells")

    steps.diagnosis = diagnosis
    assert steps.go(side_by_side) == ("stiffness", "note    no diagnosis: folded cells")


@pytest.mark.parametrize(("asked", "used"), [(None, False), (True, True), (False, False)])
def test_the_diagnosis_uses_the_images_where_the_search_does(steps: Steps, asked: bool | None, used: bool) -> None:
    steps.go(image=asked)
    assert steps.image is used  # a case without CTs has none to use unasked
