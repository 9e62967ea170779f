"""Rows of the scores: one for every effect, so that a blind spot shows, and one for every case."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np

from palpate.validate.blind.noise_floor import noise_floor_mm
from palpate.validate.blind.records import Diagnosis, Pair, Truth
from palpate.validate.blind.score_table import EffectRow, ScoreRow
from palpate.validate.blind.simulator.effects import LIBRARY, OUTSIDE

# Candidates that may be named.
MOST = 3


def by_effect(pairs: Sequence[Pair]) -> dict[str, EffectRow]:
    """A row for every effect that was hidden alone, or gave its place to another."""
    gave = Counter(name for truth, _ in pairs for name in truth.get("instead_of") or ())
    single = [pair for pair in pairs if len(pair[0]["effects"]) == 1 and pair[0]["effects"] != ["none"]]
    names = {pair[0]["effects"][0] for pair in single} | set(gave)
    ordered = sorted(names, key=lambda name: (name not in LIBRARY, name))
    return {name: _row(name, [p for p in single if p[0]["effects"] == [name]], gave[name]) for name in ordered}


def shown_floors(truth: Truth) -> float:
    """What the two stiffnesses leave of the effect, in noise floors."""
    return truth.get("effect_left_mm", 0.0) / noise_floor_mm(truth.get("noise_mm", 0.0))


def _row(name: str, pairs: Sequence[Pair], gave_place: int) -> EffectRow:
    covers = [hit for truth, found in pairs if (hit := _covers(truth, found)) is not None]
    return {
        "cases": len(pairs),
        "in_library": name in LIBRARY or name not in OUTSIDE,
        "gave_place": gave_place,
        "shown_floors": float(np.median([shown_floors(truth) for truth, _ in pairs])) if pairs else None,
        "alone": _rate(pairs, lambda d: d["verdict"] == name),
        "in_candidates": _rate(pairs, lambda d: name in d["candidates"][:MOST]),
        "first": _rate(pairs, lambda d: bool(d["ranking"]) and d["ranking"][0]["effect"] == name),
        "answered_none": _rate(pairs, lambda d: d["verdict"] == "none"),
        "refused": _rate(pairs, lambda d: d["verdict"] in ("unknown", "ambiguous")),
        "shrinkage_ci95_covers": float(np.mean(covers)) if covers else None,
    }


def _covers(truth: Truth, found: Diagnosis | None) -> bool | None:
    """Whether the interval of the shrinkage holds what the true effect achieves; None where either is not there."""
    said, true = None if found is None else found["shrinkage"], truth.get("achieved")
    if found is None or found["verdict"] == "none" or not said or not true:
        return None
    return said["ci95"][0] <= true[0] <= said["ci95"][1]


def _rate(pairs: Sequence[Pair], right: Callable[[Diagnosis], bool]) -> float | None:
    return float(np.mean([found is not None and right(found) for _, found in pairs])) if pairs else None


def confusion(pairs: Sequence[Pair]) -> dict[str, dict[str, int]]:
    """True effects (joined by +) -> verdict -> how often."""
    out: dict[str, dict[str, int]] = {}
    for truth, found in pairs:
        row = out.setdefault("+".join(truth["effects"]), {})
        verdict = "failed" if found is None else str(found["verdict"])
        row[verdict] = row.get(verdict, 0) + 1
    return out


def case_row(truth: Truth, found: Diagnosis | None) -> ScoreRow:
    """One case: truth and verdict."""
    row: ScoreRow = {
        "case": truth["name"],
        "truth": truth["effects"],
        "sizes": truth["sizes"],
        "verdict": None,
        "candidates": [],
        "effect_mm": truth.get("effect_mm"),
        "effect_left_mm": truth.get("effect_left_mm"),
        "noise_mm": truth.get("noise_mm"),
        "instead_of": truth.get("instead_of"),
        "achieved": truth.get("achieved"),
    }
    if found is not None:
        row["verdict"], row["candidates"] = found["verdict"], found["candidates"]
        row["p_value"] = found["gap"]["p_value"]
        said = found.get("shrinkage")
        row["shrinkage"] = said["noise_corrected_fraction"] if said else None
        row["shrinkage_ci95"] = said["ci95"] if said else None
    return row
