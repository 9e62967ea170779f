"""What was said of each case of the blind check."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.validate.blind.records import Diagnosis, Truth
from palpate.validate.blind.score_table import ScoreRow


def confusion(pairs: Sequence[tuple[Truth, Diagnosis | None]]) -> dict[str, dict[str, int]]:
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
