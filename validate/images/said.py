"""What one way of analysis said of one pair of scans, beside its truth."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from palpate.validate.calibration.posterior import Marginal, posteriors_of
from palpate.validate.images.records import PairTruth


@dataclass(frozen=True)
class Said:
    """What one way said of one pair. posteriors, truths : ln G (kPa) by half. verdict : "" without a diagnosis. hidden : the effect, ""
    for none; left_mm : see `HalfRow`; left_near_mm : see `HiddenFigures`. posterior : probability of every hypothesis.
    """

    pair: str
    way: str
    posteriors: Mapping[str, Marginal]
    truths: Mapping[str, float]
    verdict: str
    p_value: float | None
    candidates: tuple[str, ...]
    hidden: str
    left_mm: float | None
    changes: tuple[str, ...] = ()
    left_near_mm: float | None = None
    posterior: Mapping[str, float] = field(default_factory=dict)


def said_of(case: Path, answer: Path, way: str) -> Said | None:
    """What a case holds; None where it holds no stiffness."""
    if not (case / "result.json").exists():
        return None
    truth: PairTruth = json.loads(answer.read_text(encoding="utf-8"))
    truths = {half: float(np.log(G)) for half, G in truth["true_G_kpa"].items()}
    verdict, p, candidates, posterior = "", None, (), {}
    if (case / "diagnosis.json").exists():
        found = json.loads((case / "diagnosis.json").read_text(encoding="utf-8"))
        verdict, p, candidates = str(found["verdict"]), float(found["gap"]["p_value"]), tuple(found["candidates"])
        posterior = {str(name): float(share) for name, share in found["posterior"].items()}
    hidden, shown = "".join(truth["spec"].get("hidden", {})), truth["hidden"]
    left, near = (shown["left_mm"], shown.get("left_near_mm")) if shown else (None, None)
    changes = tuple(truth["spec"].get("scan", {}).get("changes", ()))
    halves = posteriors_of(case, "result.json")
    return Said(answer.stem, way, halves, truths, verdict, p, candidates, hidden, left, changes, near, posterior)
