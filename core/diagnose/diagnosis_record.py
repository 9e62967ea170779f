"""diagnosis.json as declared types. Keys stand in the file in the order of declaration."""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import UNSET, Meta, UnsetType

from palpate.core.diagnose.options import DiagnosisOptions

_Length = Annotated[float, Meta(ge=0.0)]
_Probability = Annotated[float, Meta(ge=0.0, le=1.0)]


class StateGapRecord(msgspec.Struct, frozen=True):
    """One deformed state's residual and what noise would leave of it, mm rms."""

    rms_mm: _Length
    noise_floor_mm: _Length


class GapRecord(msgspec.Struct, frozen=True, kw_only=True):
    """How far the plain model misses what the scans show.

    p_value : of so large or so patterned a residual under the noise. p_values : of the three statistics that it
    combines. contour_noise_sd_mm, contour_noise_correlation_mm : as estimated from the pair.
    states : of each deformed state. The optional keys are those of a pelvis; a body on a bench has none.
    """

    rms_mm: _Length
    p95_mm: _Length
    noise_floor_mm: _Length
    detected: bool
    p_value: _Probability
    statistic: float | UnsetType | None = UNSET
    degrees_of_freedom: float | UnsetType | None = UNSET
    p_values: dict[str, float | None] | UnsetType = UNSET
    contour_noise_sd_mm: float | UnsetType = UNSET
    contour_noise_correlation_mm: float | UnsetType = UNSET
    states: list[StateGapRecord] | UnsetType = UNSET


class RegionGapRecord(msgspec.Struct, frozen=True):
    """rms residual of a part of the surface, mm, and its share of the whole sum of squares.

    side : "all", "left", "anterior", ...
    """

    name: str
    side: str
    rms_mm: float | None
    share: float


class WhereRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Where the gap lies.

    map : arrays, a file of the case. peak_lps_mm : of the missing force, or the place of the likeliest effect.
    blur_mm : how far a force at one point spreads in the map.
    """

    map: str
    regions: list[RegionGapRecord]
    peak_lps_mm: tuple[float, float, float] | None
    blur_mm: float | UnsetType | None = UNSET


class ParameterRecord(msgspec.Struct, frozen=True):
    """A parameter of an effect and its standard deviation in `unit`; "1" where it has none."""

    value: float | None
    sd: float | None
    unit: str


class RankedRecord(msgspec.Struct, frozen=True, kw_only=True):
    """One effect of the library.

    residual_share : of the plain model's weighted squares that it leaves. cv_gain_mm : rms gained on data left out.
    variant : where an effect has several. refitted : whether the nonlinear model was fitted with it; else the linear
    estimate stands here.
    """

    effect: str
    probability: _Probability
    residual_share: float
    cv_gain_mm: float
    p_value: float
    parameters: dict[str, ParameterRecord]
    variant: str = ""
    log_evidence: float | UnsetType | None = UNSET
    refitted: bool | UnsetType = UNSET


class PartShrinkageRecord(msgspec.Struct, frozen=True):
    """rms of what was left out, mm: predicted by the plain model, with the effect, with a free smooth field. Distances along the normal
    ("surface"), or components of the motion in the images ("inside" the organ, "tissue" around it)."""

    before_mm: _Length
    after_mm: _Length
    ceiling_mm: _Length


class ShrinkageRecord(msgspec.Struct, frozen=True, kw_only=True):
    """How far the gap shrinks on data left out, with `effect`.

    noise_corrected_fraction : of the error in truth, without the drawing's noise; ci95 : its interval, whichever effect is the true
    one. noise_floor_mm : of the organ's contours. parts : of what is told apart; all before is of the first one.
    """

    held_out_rms_before_mm: float
    held_out_rms_after_mm: float
    fraction: float
    noise_corrected_fraction: float
    ci95: tuple[float, float]
    ceiling_fraction: float
    placebo_fraction: float
    noise_floor_mm: float | UnsetType = UNSET
    effect: str = ""
    parts: dict[str, PartShrinkageRecord] | UnsetType = UNSET


class FittedStiffnessRecord(msgspec.Struct, frozen=True):
    """Shear modulus G of a region, kPa. sd_kpa : half its central 68 % interval, or how far that reaches from a value at a bound.

    sd_ln_G : root mean square of ln G about the value found. ci95_kpa : 95 % interval of G.
    """

    G_kpa: float
    sd_kpa: float | None
    sd_ln_G: float | UnsetType | None = UNSET
    ci95_kpa: tuple[float, float] | UnsetType = UNSET


class StiffnessRecord(msgspec.Struct, frozen=True):
    """By region name; with_effect is null where no effect is named, and where contours alone mislead."""

    without_effect: dict[str, FittedStiffnessRecord]
    with_effect: dict[str, FittedStiffnessRecord] | None


class DecidedByRecord(msgspec.Struct, frozen=True):
    """The rule that decided the verdict, and its reason in words."""

    name: str
    sentence: str


class ReactionRecord(msgspec.Struct, frozen=True):
    """Reaction force of a patch along an axis, N: measured with its standard deviation, and as the model predicts it, plain
    and with the best effect (None where there is none)."""

    patch: str
    axis: str
    measured_n: float
    sd_n: float
    before_n: float | None
    after_n: float | None


class MarkersRecord(msgspec.Struct, frozen=True, kw_only=True):
    """rms misfit of one state's markers, mm.

    Of the plain model and with the best effect, fitted, and (held_out) predicted from the other states. markers : how
    many there are. noise_mm : what their own error would leave, rms. reactions : of the patches whose force was measured.
    """

    name: str
    rms_before_mm: float
    rms_after_mm: float | UnsetType = UNSET
    held_out_before_mm: float | UnsetType | None = UNSET
    held_out_after_mm: float | UnsetType | None = UNSET
    markers: int | UnsetType = UNSET
    noise_mm: _Length | UnsetType = UNSET
    reactions: list[ReactionRecord] | UnsetType = UNSET


class RemainderRecord(msgspec.Struct, frozen=True):
    """What the named effect leaves of each state, mm rms, and a second effect that explains it, if one does."""

    rms_mm: dict[str, float]
    cause: str | None


class DiagnosisRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Content of diagnosis.json.

    verdict : "none", "ambiguous", "unknown" or the id of an effect. candidates : effects that cannot be told apart.
    probability_unknown : of an effect that the library does not have. options : the numbers in force. states,
    remainder : of a body on a bench. simulated : present and true where the pair was computed. image : whether it stands on the
    motion that the two images tell too; absent in records of earlier versions and of bodies on a bench. law : the organ's, absent
    for Mooney-Rivlin. posterior : probability of
    every hypothesis: "none", an effect, two of them ("a+b"), "unknown"; they sum to 1. That of a ranking's row is given a gap.
    """

    case: str
    gap: GapRecord
    where: WhereRecord
    verdict: str
    candidates: list[str]
    ranking: list[RankedRecord]
    shrinkage: ShrinkageRecord | None
    stiffness: StiffnessRecord
    next_measurement: str | None
    why: str = ""
    decided_by: DecidedByRecord | UnsetType = UNSET
    in_words: str = ""
    probability_unknown: float = 0.0
    flags: list[str] = []
    options: DiagnosisOptions | UnsetType = UNSET
    states: list[MarkersRecord] | UnsetType = UNSET
    remainder: RemainderRecord | UnsetType | None = UNSET
    simulated: bool | UnsetType = UNSET
    image: bool | UnsetType = UNSET
    law: str | UnsetType = UNSET
    posterior: dict[str, _Probability] | UnsetType = UNSET
