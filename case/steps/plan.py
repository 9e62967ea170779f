"""Plan of a second scan: predicted precision of the stiffness for a deformation of growing amount, from the scan at
rest alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TypedDict

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.identified import identified_regions
from palpate.case.meshed import ORGAN_NAME
from palpate.case.problem import facts_of
from palpate.case.steps.declarations import PLAN
from palpate.case.steps.plan_loads import LOADS, NOTES
from palpate.case.surface_errors import StatedErrors
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.forward.known_loads import loaded
from palpate.core.identify.predicted_posterior import Prediction, predict
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import BLADDER, LABEL_VALUES, LABELS, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions, mesh_labels
from palpate.simulate.wall_motion import MovedWall
from palpate.simulate.walls import BladderSpec, RectumSpec, moved_walls

# Deformations by name: unit, default amounts, description.
DEFORMATIONS: Mapping[str, tuple[str, tuple[float, ...], str]] = {
    "balloon": ("mm", (2.0, 4.0, 6.0, 8.0), "growth of the rectum's radius by a balloon beside the prostate"),
    "emptying": ("mm", (2.0, 4.0, 6.0, 8.0), "loss of the rectum's radius as gas and stool leave"),
    "bladder": ("mm", (3.0, 6.0, 9.0, 12.0), "push of a filling bladder down on the prostate"),
    "pressure": ("kPa", (2.0, 5.0, 10.0, 15.0), "pressure in the rectum beyond that of the scan at rest"),
    "posture": ("degrees", (45.0, 90.0, 135.0, 180.0), "turn of the patient about the long axis"),
}
# Source of the assumed stiffness where none is given or identified.
_FROM_TISSUE = "the surrounding tissue's stiffness"


class NoRow(TypedDict):
    """Row of an amount without an equilibrium."""

    amount: float
    sd_ln_G: None
    reason: str


class PredictedRow(TypedDict):
    """Row of one amount. By region: standard deviation of ln G, 95 % interval (kPa), signal (mm). organ_motion_mm : of
    the surface.
    """

    amount: float
    sd_ln_G: dict[str, float]
    ci95_kpa: dict[str, list[float]]
    signal_mm: dict[str, float]
    organ_motion_mm: float
    singular_values: list[float]


class _DeformationRecord(TypedDict):
    deformation: str
    what: str
    unit: str
    element: str
    rows: list[PredictedRow | NoRow]
    verdict: str
    notes: list[str]
    research_use: bool


class PlanRecord(_DeformationRecord):
    """plan.json: assumptions, deformation, and a row for each amount; the last row may have no equilibrium."""

    case: str
    assumed_G_kpa: dict[str, float]
    assumed_from: str
    noise_sd_mm: float


@dataclass(frozen=True)
class PlanOptions:
    """deformation : key of DEFORMATIONS. amounts : ascending, in its unit. stiffness_kpa : label name -> assumed G.

    noise_sd_mm : of one contour; None for that of the case.
    """

    deformation: str = "balloon"
    amounts: tuple[float, ...] = ()
    stiffness_kpa: Mapping[str, float] | None = None
    noise_sd_mm: float | None = None
    element: str = "p2p1"
    mesh: MeshOptions = field(default_factory=MeshOptions)


def run(case: CaseFolder, options: PlanOptions | None = None, progress: Progress = silent) -> PlanRecord:
    """Write plan.json of a case and return it: the predicted standard deviation of ln G by region and amount.

    Needs rest.nii.gz only. Raises InputError when it is missing or lacks an organ that the deformation acts on,
    ConvergenceError when not even the smallest amount has an equilibrium.
    """
    options = options or PlanOptions()
    made_from = PLAN.made_from(case, asdict(options))
    unit, amounts = _unit_and_amounts(options)
    if not case.has_labels("rest"):
        raise InputError(f"{case.file('rest.nii.gz')} is not there; segment the scan at rest first")
    labels = case.labels("rest")
    progress(0.02, "mesh")
    meshed = mesh_labels(labels, options.mesh, case.file("identify") / "plan-meshes")
    names = {r: LABELS[r] for r in ORGAN_LABELS if (meshed.mesh.regions == r).any()}
    stiffness, source = _stiffness(case, options, list(names.values()))
    theta = np.log([stiffness[name] for name in names.values()])
    rows, last = list[PredictedRow | NoRow](), None
    for k, amount in enumerate(amounts):
        progress(0.2 + 0.8 * k / len(amounts), f"{options.deformation} {amount:g} {unit}")
        problem, prediction = _predicted(case, labels, meshed, names, options, amount, theta, last)
        rows.append(_row(amount, prediction, list(names.values())))
        last = prediction.equilibrium if prediction.posterior is not None else last
        if prediction.posterior is None:
            break
    if rows[0]["sd_ln_G"] is None:
        raise ConvergenceError(
            f"{options.deformation} {amounts[0]:g} {unit}: {rows[0]['reason']}; plan smaller amounts"
        )
    plan: PlanRecord = {
        "case": case.facts.name, "assumed_G_kpa": stiffness, "assumed_from": source,
        "noise_sd_mm": problem.organ_noise_mm, **_deformation_record(options, rows, list(names.values())),
    }  # fmt: skip
    case.write_json("plan.json", plan)
    PLAN.mark_done(case, made_from)
    progress(1.0, "planned")
    return plan


def _unit_and_amounts(options: PlanOptions) -> tuple[str, tuple[float, ...]]:
    """Unit and amounts of a plan. Raises InputError for an unknown deformation and for amounts that are not
    ascending.
    """
    if options.deformation not in DEFORMATIONS:
        raise InputError(f"{options.deformation!r} cannot be planned; choose one of {', '.join(DEFORMATIONS)}")
    unit, usual, _ = DEFORMATIONS[options.deformation]
    amounts = options.amounts or usual
    if list(amounts) != sorted(set(amounts)) or amounts[0] <= 0.0:
        raise InputError(f"the amounts {list(amounts)} are not positive and ascending")
    return unit, amounts


def _deformation_record(options: PlanOptions, rows: list[PredictedRow | NoRow], names: list[str]) -> _DeformationRecord:
    """Part of plan.json on the deformation."""
    unit, _, words = DEFORMATIONS[options.deformation]
    return {
        "deformation": options.deformation,
        "what": words,
        "unit": unit,
        "element": options.element,
        "rows": rows,
        "verdict": _verdict(rows, names, options.deformation, unit),
        "notes": list(NOTES.get(options.deformation, ())),
        "research_use": True,
    }


def _stiffness(case: CaseFolder, options: PlanOptions, names: list[str]) -> tuple[dict[str, float], str]:
    """Assumed G, kPa, by label name, and its source. Raises InputError where the given names are not those of the
    organ.
    """
    if options.stiffness_kpa is not None:
        wrong = set(names) ^ set(options.stiffness_kpa)
        if wrong:
            raise InputError(
                f"stiffness is to be given for {' and '.join(names)}; {', '.join(sorted(wrong))} does not fit"
            )
        return {name: float(options.stiffness_kpa[name]) for name in names}, "given"
    if case.has("result.json"):
        known = {name: region.G_kpa for name, region in identified_regions(case).items() if region.G_kpa is not None}
        if set(names) <= set(known):
            return {name: known[name] for name in names}, "result.json"
    return dict.fromkeys(names, case.facts.tissue_shear_modulus_kpa), _FROM_TISSUE


def _predicted(
    case: CaseFolder, labels: Volume, meshed: MeshedCase, names: Mapping[int, str], options: PlanOptions, amount: float,
    theta: FloatArray, last: Equilibrium | None,
) -> tuple[IdentificationProblem, Prediction]:  # fmt: skip
    """Problem whose walls have moved by one amount, as stated or under the stated load, and the prediction of the
    posterior.
    """
    problem = _problem(case, labels, meshed, names, options, amount)
    if options.deformation in LOADS:
        under_load = loaded(problem, theta, LOADS[options.deformation](case, problem, amount), options.element, last)
        if not under_load.equilibrium.converged:
            no_signal = np.full(len(theta), np.nan)
            return problem, Prediction(None, under_load.equilibrium, no_signal, np.nan, under_load.equilibrium.reason)
        problem = under_load.problem
    return problem, predict(problem, theta, last, options.element)


def _problem(
    case: CaseFolder, labels: Volume, meshed: MeshedCase, names: Mapping[int, str], options: PlanOptions, amount: float
) -> IdentificationProblem:
    moved_walls_by_name = {} if options.deformation in LOADS else _moved(labels, options.deformation, amount)
    walls = {name: _pair(wall) for name, wall in moved_walls_by_name.items()}
    organ = organ_surfaces(labels)
    pair, facts = SurfacePair(organ, organ), facts_of(case)
    if options.noise_sd_mm is not None:
        facts = replace(facts, noise_sd_mm=options.noise_sd_mm)
    else:
        errors = StatedErrors(case)
        pair = errors.planned(pair, ORGAN_NAME)
        walls = {name: errors.planned(wall, name) for name, wall in walls.items()}
    return IdentificationProblem(meshed.mesh, meshed.boundary, walls, pair, facts, dict(names))


def _moved(labels: Volume, deformation: str, amount: float) -> dict[str, MovedWall]:
    """Moved walls of a deformation. The bladder's volume changes by nine tenths of the rectum's change, with the other
    sign.
    """
    has_bladder = bool((labels.array == BLADDER).any())
    if deformation == "bladder":
        still = RectumSpec(inflate_mm=0.0) if (labels.array == RECTUM).any() else None
        return moved_walls(labels, still, BladderSpec(0.0, push_mm=(0.0, 0.0, -amount)))
    sign = 1.0 if deformation == "balloon" else -1.0
    rectum = RectumSpec(inflate_mm=sign * amount, push_mm=(0.0, -0.5 * sign * amount, 0.0), half_length_mm=60.0)
    return moved_walls(labels, rectum, BladderSpec() if has_bladder else None)


def _pair(wall: MovedWall) -> SurfacePair:
    rest = wall.surface
    return SurfacePair(rest, rest.with_points(rest.points + wall.motion.displacement(rest.points)))


def _row(amount: float, prediction: Prediction, names: list[str]) -> PredictedRow | NoRow:
    if prediction.posterior is None:
        return {"amount": amount, "sd_ln_G": None, "reason": prediction.reason}
    return {
        "amount": amount,
        "sd_ln_G": dict(zip(names, prediction.posterior.sd.tolist(), strict=True)),
        "ci95_kpa": dict(zip(names, prediction.posterior.interval().tolist(), strict=True)),
        "signal_mm": dict(zip(names, prediction.signal_mm.tolist(), strict=True)),
        "organ_motion_mm": prediction.motion_mm,
        "singular_values": prediction.posterior.singular_values.tolist(),
    }


def _verdict(rows: list[PredictedRow | NoRow], names: list[str], deformation: str, unit: str) -> str:
    """Smallest amount, in words, at which the standard deviation of ln G of each region is below 0.2."""
    parts = []
    for name in names:
        assert name in LABEL_VALUES
        predicted = [(row["amount"], row["sd_ln_G"][name]) for row in rows if row["sd_ln_G"] is not None]
        enough = [amount for amount, sd in predicted if sd < 0.2]
        best = min(sd for _, sd in predicted)
        words = f"known to 22 % or better from {enough[0]:g} {unit} on" if enough else (
            f"never better than a factor of {np.exp(best):.1f} in this range")  # fmt: skip
        parts.append(f"{name.replace('_', ' ')}: {words}")
    return f"{deformation}: " + "; ".join(parts)
