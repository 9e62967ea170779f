"""What a calibration is asked for, and what its files and its table hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypedDict

from palpate.validate.calibration.ranks import Calibration


@dataclass(frozen=True)
class CalibrationOptions:
    """cases : patients. seed : of everything random. simulator : see `simulators`. effect : hidden in every patient, None: nothing.

    bounds_kpa : the prior, even in ln G between them; they stand in every case, too. timeout_s : for one analysis.
    """

    cases: int = 200
    seed: int = 1
    workers: int = 1
    simulator: str = "blind"
    effect: str | None = None
    bounds_kpa: tuple[float, float] = (5.0, 500.0)
    timeout_s: float = 900.0


class CalibrationTruth(TypedDict):
    """The answer to one case. effects : as in the blind check's answers. true_G_kpa : by region."""

    name: str
    effects: list[str]
    true_G_kpa: dict[str, float]


class CalibrationTable(TypedDict):
    """A calibration.

    one_region : of one region of each patient, drawn at random: these are independent. by_region : of each region apart. failed :
    patients without a posterior. short : patients whom no simulation could make.
    """

    study: str
    simulator: str
    effect: str | None
    seed: int
    bounds_kpa: tuple[float, float]
    failed: int
    short: int
    one_region: Calibration | None
    by_region: dict[str, Calibration]
    ledger: str
