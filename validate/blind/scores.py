"""Figures of the blind check from pairs of truth and diagnosis."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
from scipy.stats import kstest

from palpate.core.statistics import rms
from palpate.validate.blind.noise_floor import noise_floor_mm
from palpate.validate.blind.records import Diagnosis, Pair, Truth
from palpate.validate.blind.rows import MOST, by_effect, case_row, confusion, shown_floors
from palpate.validate.blind.score_table import (
    LargeEffects,
    LargeOutside,
    NothingHidden,
    Scores,
    ShrinkageScore,
)
from palpate.validate.blind.stiffness_scores import TWO_SIDED_95, bias_ratio, coverage, errors, ln_G_error

# What the two stiffnesses leave of an effect that the shared cases call identifiable, rms mm.
IDENTIFIABLE_MM = 0.3


def scores(pairs: Sequence[Pair]) -> Scores:
    """Accuracy, refusals, false alarms, Brier score, stiffness, two baselines, the confusion and one row a case.

    A case whose diagnosis failed counts as wrong everywhere. gave_place : effects drawn first that no patient showed, and how often.
    """
    single = [p for p in pairs if _kind(p[0]) == "single"]
    none = [p for p in pairs if _kind(p[0]) == "none"]
    outside = [p for p in pairs if _kind(p[0]) == "outside"]
    double = [p for p in pairs if _kind(p[0]) == "double"]
    commonest = Counter(t["effects"][0] for t, _ in single).most_common(1)
    return {
        "cases": len(pairs),
        "failed": sum(found is None for _, found in pairs),
        "gave_place": dict(Counter("+".join(t["instead_of"]) for t, _ in pairs if t.get("instead_of"))),
        "top1": _rate(single, lambda t, d: d["verdict"] == t["effects"][0]),
        "in_candidates": _rate(single, lambda t, d: t["effects"][0] in d["candidates"][:MOST]),
        "missed": _rate(single, lambda t, d: d["verdict"] == "none"),
        "false_alarms": None if not none else 1.0 - (_rate(none, lambda t, d: d["verdict"] == "none") or 0.0),
        "nothing_hidden": _nothing_hidden(none),
        "refused_outside": _rate(outside, lambda t, d: d["verdict"] in ("unknown", "ambiguous")),
        "one_of_two": _rate(double, lambda t, d: bool(set(t["effects"]) & set(d["candidates"]))),
        "brier": _brier(single),
        "baseline_commonest": commonest[0][1] / len(single) if single else None,
        "baseline_best_evidence": _rate(single, lambda t, d: d["ranking"][0]["effect"] == t["effects"][0]),
        "large": _large(single),
        "large_outside": _large_outside(outside),
        "by_effect": by_effect(pairs),
        "location_error_mm": _location(single),
        "shrinkage": _shrinkage(single),
        "ln_G_error": ln_G_error(single),
        "stiffness_bias_ratio": bias_ratio(single),
        "stiffness_95_without": coverage(single, "without_effect"),
        "stiffness_95_with": coverage(single, "with_effect"),
        "confusion": confusion(pairs),
        "rows": [case_row(t, d) for t, d in pairs],
    }


def _kind(truth: Truth) -> str:
    if truth["effects"] == ["none"]:
        return "none"
    if not truth["in_library"]:
        return "outside"
    return "single" if len(truth["effects"]) == 1 else "double"


def _rate(pairs: Sequence[Pair], right: Callable[[Truth, Diagnosis], bool]) -> float | None:
    if not pairs:
        return None
    return float(np.mean([d is not None and bool(right(t, d)) for t, d in pairs]))


def _nothing_hidden(pairs: Sequence[Pair]) -> NothingHidden | None:
    """What the test and the stiffness do where there is nothing to find: p-values against a uniform distribution (median, and the p of
    Kolmogorov and Smirnov), and the error of ln G in its standard deviations (mean, rms, share within 1.96).
    """
    done = [(truth, found) for truth, found in pairs if found is not None]
    if not done:
        return None
    p = [found["gap"]["p_value"] for _, found in done]
    z = np.array([v for truth, found in done for v in errors(truth, found["stiffness"]["without_effect"]).values()])
    return {
        "cases": len(done),
        "p_median": float(np.median(p)),
        "p_uniform": float(kstest(p, "uniform").pvalue),
        "ln_G_mean": float(np.mean(z)),
        "ln_G_rms": rms(z),
        "ln_G_95": float(np.mean(np.abs(z) < TWO_SIDED_95)),
    }


def _brier(pairs: Sequence[Pair]) -> float | None:
    """Mean squared error of the probabilities of all effects; 0 best, 2 worst."""
    values = []
    for truth, found in pairs:
        if found is None:
            continue
        p = {row["effect"]: row["probability"] for row in found["ranking"]}
        names = set(p) | set(truth["effects"])
        values.append(sum((p.get(n, 0.0) - (n in truth["effects"])) ** 2 for n in names))
    return float(np.mean(values)) if values else None


def _large(pairs: Sequence[Pair]) -> dict[str, LargeEffects]:
    """Top-1 and set accuracy of effects that move the surface by more than twice one contour's noise, of those that do by more than
    twice the noise floor, and of those of which the two stiffnesses leave what the shared cases call identifiable.
    """
    large: dict[str, Callable[[Truth], bool]] = {
        "twice_noise": lambda t: t.get("effect_mm", 0.0) > 2.0 * t.get("noise_mm", 0.0),
        "twice_floor": lambda t: t.get("effect_mm", 0.0) > 2.0 * noise_floor_mm(t.get("noise_mm", 0.0)),
        "identifiable": lambda t: t.get("effect_left_mm", 0.0) > IDENTIFIABLE_MM,
        "shows_twice_floor": lambda t: shown_floors(t) > 2.0,
    }
    out: dict[str, LargeEffects] = {}
    for name, is_large in large.items():
        few = [p for p in pairs if is_large(p[0])]
        out[name] = {
            "cases": len(few),
            "top1": _rate(few, lambda t, d: d["verdict"] == t["effects"][0]),
            "in_candidates": _rate(few, lambda t, d: t["effects"][0] in d["candidates"][:MOST]),
        }
    return out


def _large_outside(pairs: Sequence[Pair]) -> dict[str, LargeOutside]:
    """Refusals of effects outside the library that move the surface by more than twice one contour's noise, and by more than the noise
    floor: of what no scan shows, `none` is the right answer.
    """
    least: dict[str, Callable[[float], float]] = {
        "twice_noise": lambda noise: 2.0 * noise,
        "floor": noise_floor_mm,
        "twice_floor": lambda noise: 2.0 * noise_floor_mm(noise),
    }
    out: dict[str, LargeOutside] = {}
    for name, more_than in least.items():
        few = [p for p in pairs if p[0].get("effect_mm", 0.0) > more_than(p[0].get("noise_mm", 0.0))]
        out[name] = {"cases": len(few), "refused": _rate(few, lambda t, d: d["verdict"] in ("unknown", "ambiguous"))}
    return out


def _shrinkage(pairs: Sequence[Pair]) -> ShrinkageScore:
    """What is said of the shrinkage against what the true effect achieves (`gap_achieved`), where there is both."""
    errors, inside = [], []
    for truth, found in pairs:
        said, true = None if found is None else found["shrinkage"], truth.get("achieved")
        if found is None or found["verdict"] == "none" or not said or not true:
            continue
        errors.append(abs(said["noise_corrected_fraction"] - true[0]))
        inside.append(said["ci95"][0] <= true[0] <= said["ci95"][1])
    rate = float(np.mean(inside)) if inside else None
    return {"cases": len(errors), "error": float(np.median(errors)) if errors else None, "ci95_covers": rate}


def _location(pairs: Sequence[Pair]) -> float | None:
    """Median distance (mm) from where the gap is said to come from to the true centre, of effects that have one."""
    away = []
    for truth, found in pairs:
        peak = None if found is None else found["where"]["peak_lps_mm"]
        centre = truth.get("centre_mm")
        if peak is not None and centre is not None:
            away.append(float(np.linalg.norm(np.subtract(peak, centre))))
    return float(np.median(away)) if away else None
