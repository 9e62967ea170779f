"""The way from two scans to a report: which steps are done, which can be run, and why one cannot."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

DONE, OUT_OF_DATE, READY, BLOCKED = "done", "out of date", "ready", "blocked"


@dataclass(frozen=True)
class Step:
    """command : of the command line. title : on the button. made_from, makes : files of the case, by whose times a step is
    seen to be out of date. optional : a report can be made without it."""

    command: str
    title: str
    explanation: str
    made_from: tuple[str, ...]
    makes: str
    optional: bool = False


STEPS = (
    Step("import", "Open", "Choose the scan at rest and the deformed one", (), "case.json"),
    Step("segment", "Segment", "Find prostate, bladder, rectum and bone in both scans", (), "rest.nii.gz"),
    Step("mesh", "Mesh", "Make surfaces and the finite element mesh", ("rest.nii.gz", "deformed.nii.gz"), "mesh.json"),
    Step("identify", "Stiffness", "Find the stiffness that explains the deformation", ("mesh.npz", "surfaces.npz"), "result.json"),
    Step("diagnose", "Diagnose", "Where the model is still wrong, and why", ("result.json",), "diagnosis.json", True),
    Step("report", "Report", "Write the report as a page and as a PDF", ("result.json",), "report/report.html"),
)  # fmt: skip
BY_COMMAND: Mapping[str, Step] = {step.command: step for step in STEPS}


@dataclass(frozen=True)
class StepState:
    """state : one of DONE, OUT_OF_DATE, READY, BLOCKED. reason : why it cannot be run, or what is out of date."""

    step: Step
    state: str
    reason: str = ""


def step_states(case: Path | None, available: frozenset[str], edited: bool = False) -> list[StepState]:
    """The state of every step. available : commands that this version of Palpate has. edited : labels have unsaved corrections."""
    found: list[StepState] = []
    fresh = True  # whether everything before is up to date
    for step in STEPS:
        state = _state(case, step, found, fresh, edited, available)
        found.append(state)
        if not step.optional:
            fresh = fresh and state.state == DONE
    return found


def next_step(states: list[StepState]) -> StepState | None:
    """The one thing to do next; None when the report is there."""
    for state in states:
        if state.state in (READY, OUT_OF_DATE) and not (state.step.optional and states[-1].state == DONE):
            return state
    return None


def _state(
    case: Path | None, step: Step, before: list[StepState], fresh: bool, edited: bool, available: frozenset[str]
) -> StepState:
    if step.command not in available:
        return StepState(step, BLOCKED, "this version of Palpate has no such command")
    if case is None:
        first = step.command == "import"
        return StepState(step, READY if first else BLOCKED, "" if first else "open two scans or a case first")
    needed = [state for state in before if not state.step.optional]
    if needed and needed[-1].state in (READY, BLOCKED):
        return StepState(step, BLOCKED, f"run {needed[-1].step.title} first")
    made = case / step.makes
    if not made.exists():
        return StepState(step, READY)
    if not fresh or (edited and step.command not in ("import", "segment")):
        return StepState(step, OUT_OF_DATE, "an earlier step has been changed since")
    newer = [name for name in step.made_from if (case / name).exists() and _time(case / name) > _time(made)]
    if newer:
        return StepState(step, OUT_OF_DATE, f"{newer[0]} is newer")
    return StepState(step, DONE)


def _time(path: Path) -> int:
    return path.stat().st_mtime_ns
