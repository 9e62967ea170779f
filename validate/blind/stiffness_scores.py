"""What the blind check's scores say of the stiffness: how wrong it is, without the effect that was found and with it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from palpate.core.statistics import rms
from palpate.validate.blind.records import Modulus, Pair, Truth
from palpate.validate.blind.score_table import StiffnessError

Which = Literal["without_effect", "with_effect"]
TWO_SIDED_95 = 1.96


def errors(truth: Truth, stiffness: dict[str, Modulus] | None) -> dict[str, float]:
    """Of each part's ln G, in its standard deviations."""
    return {
        name: float(np.log(s["G_kpa"] / truth["true_G_kpa"][name]) / s["sd_ln_G"])
        for name, s in (stiffness or {}).items()
    }


def coverage(pairs: Sequence[Pair], which: Which) -> float | None:
    """Share of true stiffnesses within 1.96 standard deviations of ln G."""
    inside = []
    for truth, found in pairs:
        if found is not None:
            inside += [abs(z) < TWO_SIDED_95 for z in errors(truth, found["stiffness"][which]).values()]
    return float(np.mean(inside)) if inside else None


def ln_G_error(pairs: Sequence[Pair]) -> StiffnessError | None:
    """Error of ln G over all halves, rms, without an effect and with what was found; where nothing was found it stays what it was."""
    before: list[float] = []
    after: list[float] = []
    for truth, found in pairs:
        if found is None:
            continue
        without, with_effect = found["stiffness"]["without_effect"], found["stiffness"]["with_effect"]
        before += _ln_errors(truth, without)
        after += _ln_errors(truth, with_effect or without)
    if not before:
        return None
    return {"halves": len(before), "without": rms(before), "with": rms(after)}


def _ln_errors(truth: Truth, stiffness: dict[str, Modulus] | None) -> list[float]:
    return [float(np.log(s["G_kpa"] / truth["true_G_kpa"][name])) for name, s in (stiffness or {}).items()]


def bias_ratio(pairs: Sequence[Pair]) -> float | None:
    """Median over cases of the stiffness' largest error, in its own standard deviations, with the effect over without."""
    ratios = []
    for truth, found in pairs:
        if found is None:
            continue
        with_effect, without = (
            _largest_z(truth, found["stiffness"][which]) for which in ("with_effect", "without_effect")
        )
        if with_effect is not None and without:
            ratios.append(with_effect / without)
    return float(np.median(ratios)) if ratios else None


def _largest_z(truth: Truth, stiffness: dict[str, Modulus] | None) -> float | None:
    zs = [abs(z) for z in errors(truth, stiffness).values()]
    return max(zs) if zs else None
