"""The way from two scans to a report: which steps are done, which can be run, and why one cannot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from palpate.case.steps.declarations import DIAGNOSE, IDENTIFY, IMPORT, MESH, SEGMENT
from palpate.case.steps.step import Step
from palpate.ui.report.declaration import REPORT

DONE, OUT_OF_DATE, READY, BLOCKED, CHECKING = "done", "out of date", "ready", "blocked", "checking"


@dataclass(frozen=True)
class StepButton:
    """declared : the step behind it. title : on the button. optional : a report can be made without it."""

    declared: Step
    title: str
    explanation: str
    optional: bool = False

    @property
    def command(self) -> str:
        """Of the command line."""
        return self.declared.name


STEPS = (
    StepButton(IMPORT, "Open", "Choose the scan at rest and the deformed one"),
    StepButton(SEGMENT, "Segment", "Find prostate, bladder, rectum and bone in both scans"),
    StepButton(MESH, "Mesh", "Make surfaces and the finite element mesh"),
    StepButton(IDENTIFY, "Stiffness", "Find the stiffness that explains the deformation"),
    StepButton(DIAGNOSE, "Diagnose", "Where the model is still wrong, and why", True),
    StepButton(REPORT, "Report", "Write the report as a page and as a PDF"),
)
FIRST = ("import", "segment")  # which do not depend on labels, and are not asked whether they are out of date
BY_COMMAND: Mapping[str, StepButton] = {step.command: step for step in STEPS}


@dataclass(frozen=True)
class StepState:
    """state : one of DONE, OUT_OF_DATE, READY, BLOCKED, CHECKING. reason : why it cannot be run, or what is out of date."""

    step: StepButton
    state: str
    reason: str = ""


def step_states(
    case: Path | None, available: frozenset[str], edited: bool = False, judged: Mapping[str, str] | None = None
) -> list[StepState]:
    """The state of every step. available : commands that this version of Palpate has. edited : labels have unsaved corrections.
    judged : command -> why it is out of date by its own inputs, or "" (`out_of_date.judged`), as far as that is known yet."""
    found: list[StepState] = []
    fresh = True  # whether everything before is up to date
    for step in STEPS:
        state = _state(case, step, found, fresh and not (edited and step.command not in FIRST), judged or {}, available)
        found.append(state)
        if not step.optional:
            fresh = fresh and state.state in (DONE, CHECKING)
    return found


def next_step(states: list[StepState]) -> StepState | None:
    """The one thing to do next; None when the report is there."""
    for state in states:
        if state.state in (READY, OUT_OF_DATE) and not (state.step.optional and states[-1].state == DONE):
            return state
    return None


def _state(
    case: Path | None,
    step: StepButton,
    before: list[StepState],
    fresh: bool,
    judged: Mapping[str, str],
    available: frozenset[str],
) -> StepState:
    if step.command not in available:
        return StepState(step, BLOCKED, "this version of Palpate has no such command")
    if case is None:
        first = step.command == "import"
        return StepState(step, READY if first else BLOCKED, "" if first else "open two scans or a case first")
    needed = [state for state in before if not state.step.optional]
    if needed and needed[-1].state in (READY, BLOCKED):
        return StepState(step, BLOCKED, f"run {needed[-1].step.title} first")
    if not (case / step.declared.result).exists():
        return StepState(step, READY)
    if not fresh:
        return StepState(step, OUT_OF_DATE, "an earlier step has been changed since")
    if step.command in FIRST:
        return StepState(step, DONE)
    if step.command not in judged:
        return StepState(step, CHECKING, "being compared with what it was made from")
    return StepState(step, OUT_OF_DATE, judged[step.command]) if judged[step.command] else StepState(step, DONE)
