"""Errors of local matching against a known motion, by place and by what matching says of itself."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TypedDict

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from palpate.core.arrays import FloatArray
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.motion_data import MotionData
from palpate.core.observe.motion_rows import MotionRows, mode_reader
from palpate.core.statistics import rms
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import BLADDER, RECTUM
from palpate.imaging.matching.two_scans import matched_motion
from palpate.validate.matching.pairs import KnownPair, known_pair
from palpate.validate.segmentation.contoured_scan import ContouredScan

# Shells about the prostate's surface, mm; a direction within 45 degrees of its normal is normal, others tangential.
SHELLS = {"inside": (-1e9, -4.0), "surface": (-4.0, 4.0), "4 to 15 mm": (4.0, 15.0), "15 to 25 mm": (15.0, 30.0)}
NORMAL, OUTLIER = np.sqrt(0.5), 4.0


class MatchRow(TypedDict):
    """One shell of one pair. normal_mm, tangential_mm : median size of the error of a datum in that direction; before_mm :
    the same before matching. normal_z, tangential_z : rms of error over stated error. outliers : share of data beyond
    four stated errors."""

    scan: str
    pair: int
    changes: str
    place: str
    data: int
    before_mm: float
    normal_mm: float
    tangential_mm: float
    normal_z: float
    tangential_z: float
    outliers: float


class PairRow(TypedDict):
    """One pair. scores_z, modes_z : rms of the errors of the windows' scores over what is stated, their correlation included,
    of all of them and in the modes of smooth motion that tell a stiffness. in_hollow : points inside bladder or rectum.
    seconds : of processor time."""

    scan: str
    pair: int
    points: int
    rejected: int
    in_hollow: int
    scores_z: float
    modes_z: float
    seconds: float


class MatchTable(TypedDict):
    """Rows of shells, rows of pairs; and over all pairs: rms of error over stated error in both directions, share of
    data beyond four."""

    rows: list[MatchRow]
    pairs: list[PairRow]
    normal_z: float
    tangential_z: float
    outliers: float


def matching_study(scans: Sequence[ContouredScan], count: int, seed: int, progress: Progress = silent) -> MatchTable:
    """Matches `count` pairs, made from the scans in turn; the same seed makes the same pairs."""
    rows: list[MatchRow] = []
    each: list[PairRow] = []
    told: list[tuple[FloatArray, FloatArray]] = []
    for number in range(count):
        progress(number / count, f"pair {number + 1} of {count}")
        scan = scans[number % len(scans)]
        pair = known_pair(scan, seed + number // len(scans) + 1000 * (number % len(scans)))
        began = time.process_time()
        found = matched_motion(pair.rest, pair.deformed, pair.start.at)
        seconds = time.process_time() - began
        data = MotionData.of(found)
        error = data.components(pair.motion.at(data.points) - data.moved)
        rows += _rows(scan.name, number, pair, data, error)
        each.append(_pair_row(scan.name, number, pair, found, seconds))
        told.append((error / data.sd, _is_normal(pair, data)))
    z, normal = (np.concatenate(part) for part in zip(*told, strict=True))
    normal = normal.astype(bool)
    return {
        "rows": rows, "pairs": each, "normal_z": round(rms(z[normal]), 3), "tangential_z": round(rms(z[~normal]), 3),
        "outliers": round(float((np.abs(z) > OUTLIER).mean()), 4),
    }  # fmt: skip


def matching_text(found: MatchTable) -> str:
    """The table for a person."""
    lines = [f"{'scan':18}{'pair':>5} {'place':13}{'data':>6}{'before mm':>11}{'normal':>8}{'tang.':>7}{'over stated':>13}"
             f"{'beyond 4':>10}  changes"]  # fmt: skip
    for row in found["rows"]:
        lines.append(
            f"{row['scan'][:17]:18}{row['pair']:5} {row['place']:13}{row['data']:6}{row['before_mm']:11.2f}"
            f"{row['normal_mm']:8.2f}{row['tangential_mm']:7.2f}{row['normal_z']:7.2f}{row['tangential_z']:6.2f}"
            f"{100 * row['outliers']:9.1f}%  {row['changes']}"
        )
    for p in found["pairs"]:
        lines.append(
            f"pair {p['pair']}: {p['points']} points, {p['rejected']} rejected, {p['in_hollow']} inside bladder or "
            f"rectum, scores' errors over stated {p['scores_z']:.2f}, in smooth modes {p['modes_z']:.2f}, {p['seconds']:.1f} s"
        )
    lines.append(
        f"all pairs: error over stated {found['normal_z']:.2f} normal, {found['tangential_z']:.2f} tangential; "
        f"{100 * found['outliers']:.2f} % beyond {OUTLIER:g}"
    )
    return "\n".join(lines)


def _is_normal(pair: KnownPair, data: MotionData) -> FloatArray:
    """1 where a datum's direction is nearer the normal of the prostate's surface, else 0."""
    h = np.eye(3)
    places = data.points[data.point]
    slope = np.stack([pair.distance.at(places + e) - pair.distance.at(places - e) for e in h], axis=1)
    slope /= np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9)
    return np.asarray(np.abs((slope * data.direction).sum(axis=1)) > NORMAL, dtype=np.float64)


def _rows(name: str, number: int, pair: KnownPair, data: MotionData, error: FloatArray) -> list[MatchRow]:
    before = data.components(pair.start.at(data.points) - pair.motion.at(data.points))
    distance, normal = pair.distance.at(data.points)[data.point], _is_normal(pair, data) > 0.5
    rows: list[MatchRow] = []
    for place, (low, high) in SHELLS.items():
        here = (distance >= low) & (distance < high)
        if not here.any():
            continue
        z = error / data.sd
        across, along = here & normal, here & ~normal
        rows.append(
            {
                "scan": name, "pair": number, "changes": " ".join(pair.changes), "place": place, "data": int(here.sum()),
                "before_mm": _median(before[here]), "normal_mm": _median(error[across]),
                "tangential_mm": _median(error[along]), "normal_z": round(rms(z[across]), 3) if across.any() else 0.0,
                "tangential_z": round(rms(z[along]), 3) if along.any() else 0.0,
                "outliers": round(float((np.abs(z[here]) > OUTLIER).mean()), 4),
            }
        )  # fmt: skip
    return rows


def _pair_row(name: str, number: int, pair: KnownPair, found: MatchedMotion, seconds: float) -> PairRow:
    hollow = pair.rest.labels.with_array(np.isin(pair.rest.labels.array, (BLADDER, RECTUM)).astype(np.float32))
    scores_z, modes_z = _of_scores(pair, found)
    return {
        "scan": name, "pair": number, "points": len(found.points), "rejected": len(found.rejected),
        "in_hollow": int((hollow.at(found.points) > 0.5).sum()), "scores_z": scores_z, "modes_z": modes_z,
        "seconds": round(seconds, 2),
    }  # fmt: skip


def _of_scores(pair: KnownPair, found: MatchedMotion) -> tuple[float, float]:
    """Errors of the windows' scores over what is stated, of all and in the modes of smooth motion."""
    if found.scores is None:
        return 0.0, 0.0
    rows = MotionRows.of_scores(found.scores, np.ones(len(found.scores.nodes), dtype=bool))
    error = rows.value - rows.predicted(pair.motion.at(rows.nodes))
    all_of_them = solve_triangular(cholesky(rows.covariance, lower=True), error, lower=True)
    return round(rms(all_of_them), 3), round(rms(mode_reader(rows) @ error), 3)


def _median(values: FloatArray) -> float:
    return round(float(np.median(np.abs(values))), 3) if len(values) else 0.0
