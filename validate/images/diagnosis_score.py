"""How well the posterior over causes names what pairs of scans hide."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from palpate.validate.images.records import DiagnosisScore
from palpate.validate.images.said import Said

# What an effect leaves beside the stiffness within 15 mm of the organ, rms mm, from which on it is asked for.
VISIBLE_MM = 0.3
# Names that a set may have; what the posterior calls a pair without an effect, and a cause without a name.
_MOST, _NONE, _UNNAMED = 3, "none", "unknown"
# Hidden effects that the diagnosis has no name for.
NAMELESS = frozenset({"capsule"})
# Edges of the bins of stated probabilities.
_BINS = (0.0, 0.05, 0.2, 0.5, 0.8, 1.0)


def diagnosis_score(said: Sequence[Said]) -> DiagnosisScore | None:
    """None where no pair was diagnosed."""
    asked = [of for of in said if of.posterior and (not of.hidden or (of.left_near_mm or 0.0) >= VISIBLE_MM)]
    if not asked:
        return None
    named = [of for of in asked if of.hidden and of.hidden not in NAMELESS]
    nothing, outside = [of for of in asked if not of.hidden], [of for of in asked if of.hidden in NAMELESS]
    stated, true = map(np.array, zip(*(pair for of in asked for pair in _pairs(of)), strict=True))
    return {
        "visible": len(named),
        "in_set": sum(of.hidden in (of.verdict, *of.candidates[:_MOST]) for of in named),
        "alone": sum(of.verdict == of.hidden for of in named),
        "nothing": len(nothing),
        "alarms": sum(of.verdict != _NONE for of in nothing),
        "outside": len(outside),
        "refused": sum(
            of.verdict in (_UNNAMED, "ambiguous") or of.posterior.get(_UNNAMED, 0.0) > 0.5 for of in outside
        ),
        "brier": round(float(((stated - true) ** 2).sum() / len(asked)), 3),
        "reliability": [
            {
                "count": int(here.sum()),
                "stated": round(float(stated[here].mean()), 3),
                "true": round(float(true[here].mean()), 3),
            }
            for low, high in pairwise(_BINS)
            if (here := (stated >= low) & ((stated < high) | (high == _BINS[-1]))).any()
        ],
    }


def score_text(score: DiagnosisScore) -> list[str]:
    """Lines for a person."""
    lines = [
        f"  of {score['visible']} effects that leave {VISIBLE_MM:g} mm: in the set {score['in_set']}, alone {score['alone']}; "
        f"alarms {score['alarms']} of {score['nothing']}; without a name refused {score['refused']} of {score['outside']}; "
        f"Brier score {score['brier']:.2f}"
    ]
    lines += [
        f"  stated {b['stated']:.2f}, true {b['true']:.2f} ({b['count']} hypotheses)" for b in score["reliability"]
    ]
    return lines


def _pairs(of: Said) -> list[tuple[float, bool]]:
    """Stated probability of every hypothesis, and whether it is the true one."""
    truth = _UNNAMED if of.hidden in NAMELESS else of.hidden or _NONE
    return [(of.posterior.get(name, 0.0), name == truth) for name in {*of.posterior, truth}]
