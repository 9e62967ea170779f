"""What a study of the stiffness map is asked for, and what its table holds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

# Foci of the curve: diameters, mm, and how many times as stiff as their half.
DIAMETERS_MM, TIMES = (6.0, 8.0, 12.0, 16.0), (2.0, 4.0, 8.0)


@dataclass(frozen=True)
class MapStudyOptions:
    """cases : identified, each with one deformed state. places : where each focus is put in each case. draws : of noise for each truth,
    and of truths on arrays. seed : of everything random.
    """

    cases: tuple[Path, ...]
    places: int = 2
    draws: int = 50
    seed: int = 1


class CoverRow(TypedDict):
    """How well a map holds the truth. truths : what was drawn. pairs : maps. within_one, within_two : share of the organ whose true ln G
    lies within one and two stated standard deviations. called : share of pairs in which a place is told to differ from its half. scores :
    root mean square of the errors over what is stated.
    """

    truths: str
    pairs: int
    within_one: float
    within_two: float
    scores: float
    called: float


class FocusRow(TypedDict):
    """One kind of focus. found : share of pairs in which a stiffer place is told that touches it. elsewhere : share in which one is
    told that does not. within_two : see `CoverRow`.
    """

    diameter_mm: float
    times: float
    pairs: int
    found: float
    elsewhere: float
    within_two: float


class MapTable(TypedDict):
    """cover : on arrays (truth and noise drawn from the model itself), on solved pairs (another element, another mesh), and on the cases
    themselves where their truth is known. foci : solved."""

    study: str
    seed: int
    cases: list[str]
    cover: list[CoverRow]
    foci: list[FocusRow]
