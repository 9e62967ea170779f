"""Rows of the table of what every way said of every pair."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.validate.calibration.ranks import calibration, rank
from palpate.validate.images.diagnosis_score import diagnosis_score
from palpate.validate.images.records import FoundEffect, HalfRow, WayRow
from palpate.validate.images.said import Said

# Verdicts that name no effect.
NOT_AN_EFFECT = frozenset({"none", "ambiguous", "unknown"})


def half_rows(said: Said) -> list[HalfRow]:
    """One row a half."""
    rows: list[HalfRow] = []
    for half, posterior in said.posteriors.items():
        low, high = np.exp(posterior.interval(0.95))
        truth = said.truths[half]
        rows.append(
            {
                "pair": said.pair,
                "way": said.way,
                "half": half,
                "true_kpa": round(float(np.exp(truth)), 2),
                "found_kpa": round(float(np.exp(posterior.mean)), 2),
                "interval_kpa": (round(float(low), 2), round(float(high), 2)),
                "sd_ln_G": round(posterior.sd, 3),
                "z": round((posterior.mean - truth) / posterior.sd, 2),
                "verdict": said.verdict,
                "p_value": said.p_value,
                "candidates": list(said.candidates),
                "hidden": said.hidden,
                "left_mm": said.left_mm,
                "changes": list(said.changes),
            }
        )
    return rows


def way_row(way: str, said: Sequence[Said], pairs: int, plain: Mapping[tuple[str, str], float], seed: int) -> WayRow:
    """The row of a way. pairs : how many there are. plain : standard deviations of ln G of contours alone, by pair and half."""
    rng = np.random.default_rng([seed, 86])
    halves = [
        (posterior, of.truths[half], rank(posterior, of.truths[half], rng), plain.get((of.pair, half)))
        for of in said
        for half, posterior in of.posteriors.items()
    ]
    ratios: FloatArray = np.array([posterior.sd / sd for posterior, _, _, sd in halves if sd is not None])
    diagnosed = [of for of in said if of.verdict]
    plainly = [of for of in diagnosed if not of.hidden]
    return {
        "way": way,
        "halves": calibration([(posterior, truth, at) for posterior, truth, at, _ in halves]) if halves else None,
        "failed": pairs - len(said),
        "sd_ratio": round(float(np.median(ratios)), 3) if len(ratios) else None,
        "verdicts": dict(Counter(of.verdict for of in diagnosed)),
        "alarms": sum(of.verdict != "none" for of in plainly) / len(plainly) if plainly else None,
        "p_values": sorted(round(of.p_value, 3) for of in plainly if of.p_value is not None),
        "found": {
            effect: _found([of for of in diagnosed if of.hidden == effect], effect)
            for effect in sorted({of.hidden for of in diagnosed} - {""})
        },
        "score": diagnosis_score(diagnosed),
    }


def _found(said: Sequence[Said], effect: str) -> FoundEffect:
    names = NOT_AN_EFFECT | {effect}
    return {
        "pairs": len(said),
        "candidate": sum(effect in (of.verdict, *of.candidates) for of in said),
        "alone": sum(of.verdict == effect for of in said),
        "alarm": sum(of.verdict != "none" for of in said),
        "other": sum(of.verdict not in names for of in said),
    }


def sd_by_half(said: Sequence[Said]) -> dict[tuple[str, str], float]:
    """Standard deviation of ln G by pair and half."""
    return {(of.pair, half): posterior.sd for of in said for half, posterior in of.posteriors.items()}
