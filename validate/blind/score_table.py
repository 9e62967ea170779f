"""What the scores of the blind check hold."""

from __future__ import annotations

from typing import NotRequired, TypedDict


class NothingHidden(TypedDict):
    """p-values of cases without an effect against a uniform distribution; errors of ln G in their standard deviations."""

    cases: int
    p_median: float
    p_uniform: float
    ln_G_mean: float
    ln_G_rms: float
    ln_G_95: float


class LargeEffects(TypedDict):
    """Accuracy over effects above some size."""

    cases: int
    top1: float | None
    in_candidates: float | None


class LargeOutside(TypedDict):
    """Refusals over effects above some size."""

    cases: int
    refused: float | None


class EffectRow(TypedDict):
    """How cases of one effect were answered; those of two effects count for neither.

    shown_floors : median of what shows of it, in noise floors. gave_place : times that no patient showed it and another was taken. first :
    of the ranking. Rates are over cases, failed ones included.
    """

    cases: int
    in_library: bool
    gave_place: int
    shown_floors: float | None
    alone: float | None
    in_candidates: float | None
    first: float | None
    answered_none: float | None
    refused: float | None
    shrinkage_ci95_covers: float | None


class ShrinkageScore(TypedDict):
    """Median error of what is said of the shrinkage; share of 95 % intervals that hold what is achieved."""

    cases: int
    error: float | None
    ci95_covers: float | None


# "with" is a word of the language.
StiffnessError = TypedDict("StiffnessError", {"halves": int, "without": float, "with": float})


class ScoreRow(TypedDict):
    """One case: truth and verdict; p-value and shrinkage where there is a diagnosis."""

    case: str
    truth: list[str]
    sizes: dict[str, float]
    verdict: str | None
    candidates: list[str]
    effect_mm: float | None
    effect_left_mm: float | None
    noise_mm: float | None
    instead_of: list[str] | None
    achieved: tuple[float, float, float] | None
    p_value: NotRequired[float]
    shrinkage: NotRequired[float | None]
    shrinkage_ci95: NotRequired[list[float] | None]


class Scores(TypedDict):
    """See `scores`. A rate over no case is None."""

    cases: int
    failed: int
    gave_place: dict[str, int]
    top1: float | None
    in_candidates: float | None
    missed: float | None
    false_alarms: float | None
    nothing_hidden: NothingHidden | None
    refused_outside: float | None
    one_of_two: float | None
    brier: float | None
    baseline_commonest: float | None
    baseline_best_evidence: float | None
    large: dict[str, LargeEffects]
    large_outside: dict[str, LargeOutside]
    by_effect: dict[str, EffectRow]
    location_error_mm: float | None
    shrinkage: ShrinkageScore
    ln_G_error: StiffnessError | None
    stiffness_bias_ratio: float | None
    stiffness_95_without: float | None
    stiffness_95_with: float | None
    confusion: dict[str, dict[str, int]]
    rows: list[ScoreRow]
