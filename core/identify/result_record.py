"""result.json as declared types: what an identification found. Keys stand in the file in the order of declaration."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import UNSET, Meta, UnsetType

from palpate.core.identify.options import IdentifyOptions

_Interval = tuple[float, float]
# Distances in mm, where a worker's number that is not finite arrives as null.
_Length = Annotated[float, Meta(ge=0.0)]


class RegionRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Stiffness of one region, kPa. G_kpa : small-strain shear modulus 2 (mu1 + mu2); sd_kpa half its central 68 % interval, or how far
    that reaches from a value at a bound.

    ci95_kpa : 95 % interval of G; null where unknown. sd_ln_G : root mean square of ln G about the value found.
    at_bound : whether G lies at the edge of what was allowed. quantiles_kpa : of G at probabilities 0.025, 0.05 and so
    on to 0.975. mu1_share and what follows: only where mu1 and mu2 were looked for apart.
    """

    G_kpa: Annotated[float, Meta(gt=0.0)]
    mu1_kpa: float
    mu2_kpa: float
    mu_mean_kpa: float
    sd_kpa: float | None
    ci95_kpa: _Interval | None
    sd_ln_G: float | UnsetType | None = UNSET
    at_bound: bool
    quantiles_kpa: list[float] | UnsetType = UNSET
    mu1_share: float | UnsetType = UNSET
    mu1_share_ci95: _Interval | UnsetType = UNSET
    mu1_ci95_kpa: _Interval | UnsetType = UNSET
    mu2_ci95_kpa: _Interval | UnsetType = UNSET
    mu1_mu2_separable: bool | UnsetType = UNSET


class IdentifiabilityRecord(msgspec.Struct, frozen=True, kw_only=True):
    """singular_values : of the sensitivities weighed by the noise. verdict : what the pair can tell, in words."""

    singular_values: list[float]
    mu1_mu2_separable: bool
    verdict: str


class MisfitRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Distances of the organ's predicted surface from the observed one (paper Eqs 10 to 13).

    points : of the surface that were compared. rms_before_mm : without any model. landmarks_rms_mm : of matched points within.
    expected_noise_rms_mm : what the contours' noise alone would leave. weighted : the fit's own sum of squares, all states together;
    weighted_from_noise : what noise leaves of it on average. contour_noise_from : "case", "repeats",
    "image" (estimated by the segmentation, by place) or "assumed".
    """

    rms_mm: _Length
    p95_mm: _Length
    hausdorff_mm: _Length
    objective_mm2: _Length
    points: int | UnsetType = UNSET
    rms_before_mm: _Length | UnsetType = UNSET
    contour_noise_sd_mm: _Length | UnsetType = UNSET
    landmarks_rms_mm: _Length | UnsetType = UNSET
    expected_noise_rms_mm: _Length | UnsetType = UNSET
    weighted: float | UnsetType = UNSET
    weighted_from_noise: float | UnsetType = UNSET
    contour_noise_from: Literal["case", "repeats", "image", "assumed"] | UnsetType = UNSET


class SolverRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Work done. newton_iterations : factorisations. failed : solves without an equilibrium. reduced_evaluations : of the reduced model."""

    forward_solves: int
    newton_iterations: int
    failed: int
    reduced_evaluations: int | UnsetType = UNSET
    seconds: float
    element: str | UnsetType = UNSET
    unknowns: int | UnsetType = UNSET
    linear_solver: str | UnsetType = UNSET


class AgreementRecord(msgspec.Struct, frozen=True, kw_only=True):
    """Where swarm and Gauss-Newton ended, kPa, and how far apart (`notes.agreement`)."""

    gauss_newton_G_kpa: dict[str, float]
    starts_agree: bool
    largest_ln_G_difference: float | None
    same_optimum: bool = True
    harmless: bool = True
    in_words: str = ""
    swarm_G_kpa: dict[str, float] | UnsetType = UNSET
    difference_sd: dict[str, float | None] | UnsetType = UNSET


class LandmarkRecord(msgspec.Struct, frozen=True):
    """Distances of landmarks after one way of moving them, mm."""

    mm: list[float]
    rms_mm: float


class PlaceRecord(msgspec.Struct, frozen=True, kw_only=True):
    """A place that differs from most of its half (`identify.map.places`). half : label name. centre_mm : in the scan at rest (LPS).

    G_kpa : at the patch that differs most, with its 95 % interval. times : that over the half's value.
    """

    half: str
    sense: Literal["stiffer", "softer"]
    volume_cc: float
    centre_mm: tuple[float, float, float]
    G_kpa: float
    ci95_kpa: _Interval
    times: float


class MapRecord(msgspec.Struct, frozen=True, kw_only=True):
    """The stiffness map within the organ (`identify.map.stiffness_map`). file : in the case folder.

    told_share_of_volume : where the data say more of a deviation than the prior does. resolved_values, blur_mm : independent values, and
    over which distance each averages, were there a deviation. prior_local_sd_ln_G, prior_length_mm : of the deviation from the half's
    value, as the data choose them. uniform_probability : that a half has no deviation. places : that differ from their half, all of
    them at once with probability `level`.
    """

    file: str
    patches: int
    told_share_of_volume: float
    resolved_values: float
    blur_mm: float | None
    steps: int
    settled: bool
    prior_local_sd_ln_G: float
    prior_length_mm: float
    uniform_probability: dict[str, float] | UnsetType = UNSET
    level: float | UnsetType = UNSET
    places: list[PlaceRecord] | UnsetType = UNSET


class IdentificationRecord(msgspec.Struct, frozen=True, kw_only=True):
    """What the worker's job found: result.json without what only the case knows. Regions by label name (``prostate_left``).

    states : the misfit of every deformed state. convergence : of the objective, over iterations. landmarks : of pairs whose organ's
    surface is all that is seen, by way of moving them.
    """

    parameters: Annotated[dict[str, RegionRecord], Meta(extra_json_schema={"minProperties": 1})]
    identifiability: IdentifiabilityRecord
    misfit: MisfitRecord
    states: list[MisfitRecord] | UnsetType = UNSET
    solver: SolverRecord
    method: Literal["swarm", "gauss-newton"]
    boundary: Literal["coupled", "contact-force"]
    seed: int
    options: IdentifyOptions | UnsetType = UNSET
    convergence: list[float | None] = []
    agreement: AgreementRecord | UnsetType = UNSET
    notes: list[str] = []
    landmarks: dict[str, LandmarkRecord] | UnsetType = UNSET
    stiffness_map: MapRecord | None = None


class ResultRecord(IdentificationRecord, frozen=True, kw_only=True):
    """result.json. versions : of the packages that the answer depends on. inputs_sha256 : by file of the case.

    simulated : present and true where the pair was computed. missing : what the case lacks for the values to be believed,
    and stiffness at a bound, one line each. contour_errors_mm : estimated by the segmentation, rms over a surface, by state
    and surface ("organ", "bladder", "rectum"); present where the inference used them.
    """

    versions: dict[str, str]
    inputs_sha256: dict[str, str]
    simulated: bool | UnsetType = UNSET
    missing: list[str] | UnsetType = UNSET
    contour_errors_mm: dict[str, dict[str, float]] | UnsetType = UNSET


class ReidentificationRecord(msgspec.Struct, frozen=True, kw_only=True):
    """again.json: the stiffness from other contours of the deformed organ. model_error_mm : of the reduced model.

    seconds, cpu_seconds : from the organ's surface to the stiffness.
    """

    parameters: dict[str, RegionRecord]
    identifiability: IdentifiabilityRecord
    misfit: MisfitRecord
    model_error_mm: float
    walls: str
    seconds: float
    cpu_seconds: float
    labels_sha256: str
    options: IdentifyOptions
    research_use: bool = True
