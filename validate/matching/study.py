"""Errors of local matching against a known motion, by place and by what matching says of itself."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from typing import TypedDict

import numpy as np
from scipy import ndimage

from palpate.core.arrays import FloatArray
from palpate.core.statistics import rms
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.matching.local_matching import MatchedMotion, match
from palpate.validate.matching.pairs import KnownPair, known_pair
from palpate.validate.segmentation.contoured_scan import ContouredScan

# Shells about the prostate's surface, mm, and the largest stated error, mm, of a component that counts as told.
SHELLS = {"prostate's surface": (-4.0, 4.0), "4 to 15 mm around": (4.0, 15.0), "15 to 30 mm around": (15.0, 30.0)}
TOLD_MM, OUTLIER = 1.0, 4.0


class MatchRow(TypedDict):
    """One shell of one pair. Errors in mm: rms along the eigenvectors of the precision that are told; over_stated : rms of
    error over stated error; outliers : share beyond four of them; start : rms error of an axis before matching."""

    scan: str
    pair: int
    place: str
    points: int
    told: int
    start: float
    error: float
    median: float
    over_stated: float
    outliers: float


class MatchTable(TypedDict):
    """Rows, and the longest matching in seconds."""

    rows: list[MatchRow]
    slowest_seconds: float


def matching_study(scans: Sequence[ContouredScan], count: int, seed: int, progress: Progress = silent) -> MatchTable:
    """Matches `count` pairs, made from the scans in turn; the same seed makes the same pairs."""
    rows: list[MatchRow] = []
    slowest = 0.0
    for number in range(count):
        progress(number / count, f"pair {number + 1} of {count}")
        scan = scans[number % len(scans)]
        pair = known_pair(scan, seed + number)
        began = time.perf_counter()
        motion = match(pair.first, pair.second, pair.usable, partial(_sampled, pair, pair.start))
        slowest = max(slowest, time.perf_counter() - began)
        rows += _rows(scan.name, number, pair, motion)
    return {"rows": rows, "slowest_seconds": round(slowest, 2)}


def matching_text(found: MatchTable) -> str:
    """The table for a person."""
    lines = [f"{'scan':10}{'pair':>5} {'place':20}{'points':>7}{'told':>6}{'start mm':>10}{'error mm':>10}{'median':>8}"
             f"{'over stated':>13}{'beyond 4':>10}"]  # fmt: skip
    for row in found["rows"]:
        lines.append(
            f"{row['scan']:10}{row['pair']:5} {row['place']:20}{row['points']:7}{row['told']:6}{row['start']:10.2f}"
            f"{row['error']:10.2f}{row['median']:8.2f}{row['over_stated']:13.2f}{100 * row['outliers']:9.1f}%"
        )
    lines.append(f"slowest matching {found['slowest_seconds']:.1f} s")
    return "\n".join(lines)


def _sampled(pair: KnownPair, field: FloatArray, points: FloatArray) -> FloatArray:
    index = pair.first.to_index(points).T
    return np.stack([ndimage.map_coordinates(field[..., a], index, order=1, mode="nearest") for a in range(3)], axis=-1)


def _rows(name: str, number: int, pair: KnownPair, motion: MatchedMotion) -> list[MatchRow]:
    truth = _sampled(pair, pair.motion, motion.points)
    before = _sampled(pair, pair.start, motion.points) - truth
    information, axes = np.linalg.eigh(motion.precision)
    along = np.einsum("nki,nk->ni", axes, motion.displacement - truth)
    stated = 1.0 / np.sqrt(np.maximum(information, 1e-12))
    distance = ndimage.map_coordinates(pair.distance, pair.first.to_index(motion.points).T, order=1, mode="nearest")
    rows: list[MatchRow] = []
    for place, (low, high) in SHELLS.items():
        here = (distance >= low) & (distance < high)
        told = here[:, None] & (stated < TOLD_MM)
        if told.any():
            z = along[told] / stated[told]
            rows.append(
                {
                    "scan": name, "pair": number, "place": place, "points": int(here.sum()), "told": int(told.sum()),
                    "start": round(rms(before[here]), 3), "error": round(rms(along[told]), 3),
                    "median": round(float(np.median(np.abs(along[told]))), 3), "over_stated": round(rms(z), 3),
                    "outliers": round(float((np.abs(z) > OUTLIER).mean()), 4),
                }
            )  # fmt: skip
    return rows
