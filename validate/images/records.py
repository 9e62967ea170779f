"""What a study of images is asked for, and what its files and its table hold."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from palpate.simulate.hidden_figures import HiddenFigures
from palpate.validate.calibration.ranks import Calibration


@dataclass(frozen=True)
class ImagesOptions:
    """scans : CT series and contours drawn on it, taken in turn. pairs : how many. seed : of everything random. timeout_s : for one
    command on one pair. hide : effects, one in each pair, taken in turn; none where it is empty. ways : to go, of `ways.WAYS`; all where
    it is empty. contour_error : standard deviation and correlation length, mm, of the drawn contours' errors, which the case then
    states; the study's own, unstated, where None. diagnosis : whether the gap is diagnosed too.
    """

    scans: tuple[tuple[Path, Path], ...]
    pairs: int = 2
    seed: int = 1
    workers: int = 1
    timeout_s: float = 3600.0
    hide: tuple[str, ...] = ()
    ways: tuple[str, ...] = ()
    contour_error: tuple[float, float] | None = None
    diagnosis: bool = True


class PairScan(TypedDict, total=False):
    """changes : of `ScanFile`."""

    changes: list[str]


class PairSpec(TypedDict, total=False):
    """What it reads of the specification. hidden : by effect."""

    hidden: dict[str, object]
    scan: PairScan


class PairTruth(TypedDict):
    """What a study reads of `Answers`, the truth of a simulated pair."""

    true_G_kpa: dict[str, float]
    spec: PairSpec
    hidden: HiddenFigures | None


class Bin(TypedDict):
    """Hypotheses whose stated probability lies in a bin: how many, the mean of what was stated, and how often they were true."""

    count: int
    stated: float
    true: float


class DiagnosisScore(TypedDict):
    """visible : pairs whose effect has a name and shows; in_set, alone : of them, the effect among at most three names, the only one.
    nothing, alarms : pairs that hide nothing, and those not answered `none`. outside, refused : pairs whose effect shows and has no
    name; `unknown`, `ambiguous`, or more than half of the probability for what has no name. brier : mean squared error of all
    probabilities of these pairs, 0 to 2. reliability : of the same probabilities.
    """

    visible: int
    in_set: int
    alone: int
    nothing: int
    alarms: int
    outside: int
    refused: int
    brier: float
    reliability: list[Bin]


class FoundEffect(TypedDict):
    """Diagnoses of pairs that hide one effect: how many, and in how many it is among the candidates, is the only name, an alarm is raised
    at all, and another effect is the only name.
    """

    pairs: int
    candidate: int
    alone: int
    alarm: int
    other: int


class WayRow(TypedDict):
    """One way to an answer, over all pairs. halves : of both halves of each pair; those of one pair are not independent. failed : pairs
    without an answer. sd_ratio : median of the standard deviations of ln G over those of contours alone, of the same halves.
    verdicts : of the diagnoses, by how many. alarms : share that is not `none` of pairs that hide nothing: all of them are false.
    p_values : of these. found : by hidden effect. score : of the diagnoses' probabilities.
    """

    way: str
    halves: Calibration | None
    failed: int
    sd_ratio: float | None
    verdicts: dict[str, int]
    alarms: float | None
    p_values: list[float]
    found: dict[str, FoundEffect]
    score: DiagnosisScore | None


class HalfRow(TypedDict):
    """One half of one pair by one way: kPa, and z, how far the found ln G lies above the true one in its standard deviations (the
    calibration's z has the other sign: there it is the truth's place). hidden, left_mm : the pair's effect, and
    what of it no change of stiffness shows on the organ's surface as well, rms mm. changes : what else differs in the
    second scan.
    """

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
    candidates: list[str]
    hidden: str
    left_mm: float | None
    changes: list[str]


class ImagesTable(TypedDict):
    """A study of images. short : pairs that no simulation could make. unmade : by pair, why not, for each wall motion that was tried."""

    study: str
    seed: int
    rows: list[WayRow]
    halves: list[HalfRow]
    short: int
    unmade: dict[str, list[str]]
    ledger: str


Specification = Mapping[str, object]
