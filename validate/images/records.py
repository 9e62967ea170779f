"""What a study of images is asked for, and what its files and its table hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from palpate.validate.calibration.ranks import Calibration


@dataclass(frozen=True)
class ImagesOptions:
    """scans : CT series and contours drawn on it, taken in turn. pairs : how many. seed : of everything random. timeout_s : for one
    command on one pair.
    """

    scans: tuple[tuple[Path, Path], ...]
    pairs: int = 2
    seed: int = 1
    workers: int = 1
    timeout_s: float = 3600.0


class PairTruth(TypedDict):
    """What a study reads of `Answers`, the truth of a simulated pair."""

    true_G_kpa: dict[str, float]


class WayRow(TypedDict):
    """One way to an answer, over all pairs. halves : of both halves of each pair; those of one pair are not independent. failed : pairs
    without an answer. sd_ratio : median of the standard deviations of ln G over those of contours alone, of the same halves.
    verdicts : of the diagnoses, by how many. alarms : share that is not `none`; nothing is hidden, so all of them are false.
    """

    way: str
    halves: Calibration | None
    failed: int
    sd_ratio: float | None
    verdicts: dict[str, int]
    alarms: float | None
    p_values: list[float]


class HalfRow(TypedDict):
    """One half of one pair by one way: kPa, and how far ln G is off in its standard deviations."""

    pair: str
    way: str
    half: str
    true_kpa: float
    found_kpa: float
    interval_kpa: tuple[float, float]
    sd_ln_G: float
    z: float
    verdict: str
    p_value: float | None


class ImagesTable(TypedDict):
    """A study of images. short : pairs that no simulation could make."""

    study: str
    seed: int
    rows: list[WayRow]
    halves: list[HalfRow]
    short: int
    ledger: str


Specification = Mapping[str, object]
