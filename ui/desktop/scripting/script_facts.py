"""What a script of the window can expect: its facts, and a fact in words."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypedDict

from palpate.core.errors import InputError
from palpate.ui.desktop.session.controller import Controller


class WindowFacts(TypedDict):
    """What is told of the window: case and labels shown, the job and how it ended, and the state of every step by its command."""

    case: bool
    unsaved: bool
    job: str
    cancel_seconds: float | None
    said: str
    labels: list[str]
    seeds: int
    simulated: bool
    steps: dict[str, str]


def facts_of(controller: Controller) -> WindowFacts:
    """Facts that every event tells; JSON-able."""
    job, case = controller.jobs.state, controller.case
    return {
        "case": case is not None,
        "unsaved": case is not None and case.corrections.unsaved,
        "job": "none" if job is None else (job.outcome or "running"),
        "cancel_seconds": None if job is None else job.cancel_seconds,
        "said": controller.said,
        "labels": sorted(() if case is None else case.volumes),
        "seeds": 0 if case is None else sum(map(len, case.seeds.values())),
        "simulated": case is not None and bool(case.simulated),
        "steps": {s.step.command: s.state for s in controller.steps()},
    }


def expect(facts: WindowFacts, name: str, value: str) -> None:
    """Raises InputError unless a fact has a value; of `steps` one is named with a dot."""
    first, _, further = name.partition(".")
    values: Mapping[str, object] = facts
    if first not in values or bool(further) != (first == "steps") or (further and further not in facts["steps"]):
        known = [n for n in facts if n != "steps"] + [f"steps.{n}" for n in facts["steps"]]
        raise InputError(f"there is no fact {name!r}; give one of {', '.join(known)}")
    found = _in_words(facts["steps"][further] if further else values[first])
    if found.casefold() != value.casefold():
        raise InputError(f"{name} is {found or 'empty'}, not {value or 'empty'}")


def _in_words(value: object) -> str:
    """A fact as a script writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return ",".join(map(str, value))
    return "none" if value is None else str(value)
