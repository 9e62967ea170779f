"""The records of a blind case as they lie in its files: what is true of it, and what the scores read of its diagnosis."""

from __future__ import annotations

from typing import NotRequired, TypedDict


class Truth(TypedDict):
    """The answer to one case: effects ("none" alone: nothing is hidden), their sizes, and G of each half, kPa.

    wanted_mm, effect_mm, effect_left_mm : how far the effects move the organ's surface, rms along the normal: as asked for, all of it, and
    what the two stiffnesses leave of it. noise_mm : standard deviation of one contour. centre_mm : where the effect is, if anywhere.
    shares : see `Recipe.shares`, of each further state. achieved : see `achieved`, where it could be told.
    """

    name: str
    effects: list[str]
    sizes: dict[str, float]
    instead_of: NotRequired[list[str]]
    in_library: bool
    true_G_kpa: dict[str, float]
    wanted_mm: NotRequired[float | None]
    effect_mm: NotRequired[float]
    effect_left_mm: NotRequired[float]
    noise_mm: NotRequired[float]
    noise: NotRequired[dict[str, object]]
    stated_noise_mm: NotRequired[float | None]
    voxel_mm: NotRequired[list[float]]
    has_fat_planes: NotRequired[bool]
    free_edge: NotRequired[bool]
    centre_mm: NotRequired[list[float] | None]
    states: NotRequired[int]
    shares: NotRequired[list[dict[str, float]]]
    achieved: NotRequired[tuple[float, float, float] | None]


class Gap(TypedDict):
    """Of the test whether there is a gap at all."""

    p_value: float


class Ranked(TypedDict):
    """One effect and its posterior probability."""

    effect: str
    probability: float


class Modulus(TypedDict):
    """G of one half, kPa, and the standard deviation of its logarithm."""

    G_kpa: float
    sd_ln_G: float


class BothStiffnesses(TypedDict):
    """By half; None where there is none."""

    without_effect: dict[str, Modulus] | None
    with_effect: dict[str, Modulus] | None


class Shrinkage(TypedDict):
    """Share of the gap that the effect takes away, and its 95 % interval."""

    noise_corrected_fraction: float
    ci95: list[float]


class Where(TypedDict):
    """File of the maps, relative to the case; where the gap is said to come from."""

    map: str
    peak_lps_mm: list[float] | None


class Diagnosis(TypedDict):
    """What the scores read of diagnosis.json."""

    verdict: str
    candidates: list[str]
    ranking: list[Ranked]
    gap: Gap
    stiffness: BothStiffnesses
    shrinkage: Shrinkage | None
    where: Where


Pair = tuple[Truth, Diagnosis | None]
