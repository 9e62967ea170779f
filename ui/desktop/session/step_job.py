"""A job that runs steps of a case, one after the other, in the window's worker: what a terminal does, without a command line."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import msgspec

from palpate.case import history
from palpate.case.case_folder import CaseFolder
from palpate.core.worker.executors import cores
from palpate.core.worker.inline import run_inline
from palpate.core.worker.job import Job
from palpate.core.worker.lifeline import give_way
from palpate.core.worker.messages import Message, Reporter
from palpate.ui.desktop.session.step_requests import RequestData, StepRequest

KIND = "palpate.ui.desktop.session.step_job:run"
# What a step's own sums tell beside how far they are.
_DETAILS = ("best", "iteration", "particles")


class _Teller:
    """A step's progress as messages. Each has `step`, `step_fraction` and the fraction of all steps."""

    def __init__(self, reporter: Reporter, number: int, count: int, step: str) -> None:
        self._reporter, self._number, self._count, self._step = reporter, number, count, step
        self._details: dict[str, object] = {}

    def __call__(self, fraction: float, message: str) -> None:
        """One progress message."""
        whole = (self._number + min(max(fraction, 0.0), 1.0)) / self._count
        self._reporter.progress(whole, message, step=self._step, step_fraction=fraction, **self._details)

    def do_job(self, job: Job, on_message: Callable[[Message], None]) -> dict[str, object]:
        """Does a step's job in this process; particles and objective go along with the step's own progress."""

        def hear(message: Message) -> None:
            self._details = {key: message[key] for key in _DETAILS} if "particles" in message else {}
            on_message(message)
            self._details = {}

        return run_inline(job, hear)


def steps_job(requests: Sequence[StepRequest], folder: Path) -> Job:
    """The job that runs steps. folder : for its messages and log."""
    return Job(KIND, str(folder), options={"steps": [request.to_dict() for request in requests]}, workers=cores())


class _StepsJob(msgspec.Struct, frozen=True):
    steps: list[RequestData]


def run(job: Job, reporter: Reporter) -> dict[str, object]:
    """Options: steps, a list of `StepRequest.to_dict`. Returns what each step returned, by its name."""
    give_way()
    requests = [StepRequest.from_dict(given) for given in job.options_as(_StepsJob).steps]
    results = {}
    for number, request in enumerate(requests):
        teller = _Teller(reporter, number, len(requests), request.step.name)
        teller(0.0, "starting")
        results[request.step.name] = _import(request, teller) if request.scans else _on_case(request, teller)
    return results


def _import(request: StepRequest, teller: _Teller) -> object:
    assert request.scans is not None
    found = request.step.function()(*request.scans, request.case, request.options, teller)
    with history.recorded(CaseFolder(request.case), request.step.name, request.typed):
        return found


def _on_case(request: StepRequest, teller: _Teller) -> object:
    case = CaseFolder(request.case)
    more = {"do_job": teller.do_job} if request.step.has_job else {}
    with history.recorded(case, request.step.name, request.typed):
        return request.step.function()(case, request.options, teller, **more)
