"""What a script of the window can expect: its facts, and a fact in words."""

from __future__ import annotations

from typing import Any

from palpate.core.errors import InputError
from palpate.ui.desktop.session.controller import Controller


def facts_of(controller: Controller) -> dict[str, Any]:
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


def expect(facts: dict[str, Any], name: str, value: str) -> None:
    """Raises InputError unless a fact has a value; of `steps` one is named with a dot."""
    first, _, further = name.partition(".")
    if first not in facts or bool(further) != (first == "steps") or (further and further not in facts["steps"]):
        known = [n for n in facts if n != "steps"] + [f"steps.{n}" for n in facts["steps"]]
        raise InputError(f"there is no fact {name!r}; give one of {', '.join(known)}")
    found = _in_words(facts["steps"][further] if further else facts[first])
    if found.casefold() != value.casefold():
        raise InputError(f"{name} is {found or 'empty'}, not {value or 'empty'}")


def _in_words(value: Any) -> str:
    """A fact as a script writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return ",".join(map(str, value))
    return "none" if value is None else str(value)
