"""A diagnosis in the form of diagnosis.json."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.detection.location import DiscrepancyMaps, MotionGap, discrepancy_maps, regions, residuals
from palpate.core.diagnose.diagnosis_record import (
    DecidedByRecord,
    DiagnosisRecord,
    FittedStiffnessRecord,
    GapRecord,
    StateGapRecord,
    StiffnessRecord,
    WhereRecord,
)
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.bounds_reached import bounds_reached
from palpate.core.diagnose.verdict.judge import Diagnosis
from palpate.core.diagnose.verdict.model_average import model_average, plain_stiffness
from palpate.core.diagnose.verdict.ranking import ranking
from palpate.core.diagnose.verdict.shrinkage import shrinkage
from palpate.core.diagnose.verdict.stiffness_with_effect import leading
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE, UNKNOWN
from palpate.core.diagnose.verdict.words import next_measurement, sentence
from palpate.core.inference.posterior import as_before
from palpate.core.residual.contours_alone import answer, misleading_contours
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.statistics import rms

MAP_FILE = "gap_maps.npz"
# Standard deviations of a normal distribution to either side that hold 95 %.
_TWO_SIDED = 1.96


def record(diagnosis: Diagnosis, case: str) -> DiagnosisRecord:
    """diagnosis.json for a case of this name."""
    best = leading(diagnosis)
    shown = best if diagnosis.verdict.verdict not in (NONE, UNKNOWN) else None
    told = shown is not None and not misleading_contours(diagnosis.fit)
    names = dict(diagnosis.fit.model.first.plain.problem.region_names)
    return DiagnosisRecord(
        case=case,
        gap=_gap(diagnosis),
        where=WhereRecord(
            map=MAP_FILE,
            regions=regions(diagnosis.discrepancy, names),
            peak_lps_mm=_peak(diagnosis),
            blur_mm=diagnosis.discrepancy.blur_mm,
        ),
        verdict=diagnosis.verdict.verdict,
        candidates=list(diagnosis.verdict.candidates),
        ranking=ranking(
            diagnosis.fit,
            diagnosis.screened,
            diagnosis.refits,
            diagnosis.verdict.probability,
            {name: gain.before_mm - gain.after_mm for name, gain in diagnosis.gains.items()},
        ),
        shrinkage=None if best is None else shrinkage(diagnosis, best),
        stiffness=StiffnessRecord(
            without_effect=_plain_stiffness(diagnosis),
            with_effect=_stiffness_with(diagnosis, *model_average(diagnosis)) if told else None,
        ),
        next_measurement=next_measurement(diagnosis),
        why=diagnosis.verdict.why,
        decided_by=DecidedByRecord(diagnosis.verdict.decided_by, diagnosis.verdict.why),
        in_words=sentence(diagnosis),
        probability_unknown=diagnosis.verdict.probability.get(UNKNOWN, 0.0),
        flags=_flags(diagnosis, shown),
        options=_options(diagnosis),
        posterior=dict(diagnosis.verdict.posterior),
    )


def _options(diagnosis: Diagnosis) -> DiagnosisOptions:
    """The numbers in force."""
    walls = diagnosis.fit.model.first.geometry.walls
    return DiagnosisOptions(noise_model=diagnosis.fit.options, wall_motion=walls, decision_rules=diagnosis.rules)


def _peak(diagnosis: Diagnosis) -> tuple[float, float, float] | None:
    """Where the gap comes from: the place of the likeliest effect if it has one, else where the missing force is
    largest."""
    for fitted in diagnosis.refits:
        effect, variant = fitted.hypothesis.effect, fitted.hypothesis.variant
        if effect is None or variant is None or effect.id not in diagnosis.verdict.candidates or variant.where is None:
            continue
        names = [p.name for p in effect.parameters]
        shift = [fitted.phi[names.index(f"shift_{axis}")] if f"shift_{axis}" in names else 0.0 for axis in "xyz"]
        return _point(np.asarray(variant.where) + shift)
    return None if diagnosis.discrepancy.peak is None else _point(diagnosis.discrepancy.peak)


def _point(x: FloatArray) -> tuple[float, float, float]:
    return float(x[0]), float(x[1]), float(x[2])


def maps(diagnosis: Diagnosis) -> dict[str, FloatArray]:
    """Arrays of MAP_FILE: points, normals, residual_mm, standardised (surface); nodes_mm, force_kpa_per_mm (around it).

    predicted/ID (q, 3) mm : where the surface's points go by the plain model ("plain") and by each refitted effect;
    correction/ID (q,) is what better element and other meshes add to that along the normal, offset/ID (1,) by how much
    the effect has the contour too wide. motion/ (w, 3) : predicted minus matched motion in and around the organ, from images, in mm
    and over its standard deviation. Further deformed states have the same under state_2/ and so on.
    """
    out: dict[str, FloatArray] = {}
    for state in range(len(diagnosis.fit.model.each)):
        discrepancy = (
            diagnosis.discrepancy
            if state == 0
            else discrepancy_maps(diagnosis.fit, diagnosis.forces, diagnosis.rules, state)
        )
        out |= {f"{_prefix(state)}{key}": values for key, values in _maps(diagnosis, state, discrepancy).items()}
    return out


def _prefix(state: int) -> str:
    return f"state_{state + 1}/" if state else ""


def _maps(diagnosis: Diagnosis, state: int, discrepancy: DiscrepancyMaps) -> dict[str, FloatArray]:
    """Of one deformed state."""
    data, rows = diagnosis.fit.model.data_vectors[state], diagnosis.fit.model.rows[state]
    models = {"plain": (diagnosis.fit.linearisation, diagnosis.fit.model.correction)} | {
        f.hypothesis.effect.id: (f.linearisation, f.correction)
        for f in (*diagnosis.refits, *diagnosis.pairs)
        if f.hypothesis.effect is not None
    }
    out: dict[str, FloatArray] = {}
    for name, (points, correction) in models.items():
        linearisation = points.each[state]
        out[f"predicted/{name}"] = _predicted(linearisation)
        out[f"correction/{name}"] = data.modes @ correction.at(linearisation.theta)[rows][: data.n_modes]
        out[f"offset/{name}"] = np.array([linearisation.scene.composition.observation])
    around = MotionGap.of(diagnosis.fit, state)
    return out | {
        "points": discrepancy.points,
        "normals": discrepancy.normals,
        "region": discrepancy.region.astype(float),
        "residual_mm": discrepancy.residual,
        "motion/places": around.places,
        "motion/residual_mm": around.missed,
        "motion/standardised": around.standardised,
        "standardised": discrepancy.standardised,
        "nodes": discrepancy.nodes,
        "force_kpa_per_mm": discrepancy.force,
    }  # fmt: skip


def _predicted(linearisation: Linearisation) -> FloatArray:
    observation = linearisation.scene.observation
    return np.asarray(observation.points + observation.operator @ linearisation.scene.seen(linearisation.equilibrium.u))


def _gap(diagnosis: Diagnosis) -> GapRecord:
    fit = diagnosis.fit
    state_residuals, floors = residuals(fit), fit.noise_rms_mm
    residual = np.abs(np.concatenate(state_residuals))
    return GapRecord(
        rms_mm=rms(residual),
        p95_mm=float(np.quantile(residual, 0.95)),
        noise_floor_mm=rms(np.array(floors)),
        detected=diagnosis.test.detected,
        p_value=diagnosis.test.p_value,
        statistic=diagnosis.test.log_factor,
        p_values={"smooth": diagnosis.test.p_smooth, "named": diagnosis.test.p_named},
        contour_noise_sd_mm=fit.sizes.contour * fit.linearisation.first.scene.problem.organ_noise_mm,
        contour_noise_correlation_mm=float(np.dot(fit.sizes.shares, fit.options.lengths_mm)),
        states=[StateGapRecord(rms(r), floor) for r, floor in zip(state_residuals, floors, strict=True)],
    )


def _stiffness_with(
    diagnosis: Diagnosis, theta: FloatArray, covariance: FloatArray
) -> dict[str, FittedStiffnessRecord]:
    """With an effect: ln G (t,) normal about theta with this covariance (t, t), cut at the bounds."""
    names, bounds = diagnosis.fit.model.first.plain.problem.region_names, diagnosis.fit.bounds
    at_bound = bounds_reached(diagnosis.fit, theta, diagnosis.rules)
    sd = np.sqrt(np.diag(covariance))
    out = {}
    for k, (region, t, s) in enumerate(zip(sorted(names), theta.tolist(), sd.tolist(), strict=True)):
        low, high = np.exp(np.clip([t - s, t + s], *bounds[k])).tolist()
        ends = np.exp(np.clip([t - _TWO_SIDED * s, t + _TWO_SIDED * s], *bounds[k])).tolist()
        width = high - low if k in at_bound else 0.5 * (high - low)
        out[names[region]] = FittedStiffnessRecord(float(np.exp(t)), width, s, (ends[0], ends[1]))
    return out


def _plain_stiffness(diagnosis: Diagnosis) -> dict[str, FittedStiffnessRecord]:
    """Without an effect, to the last digit what `identify` reports."""
    posterior, names = answer(diagnosis.fit), diagnosis.fit.model.first.plain.problem.region_names
    columns = zip(np.exp(posterior.mean), posterior.sd_kpa(), posterior.sd, posterior.interval().tolist(), strict=True)
    found = [FittedStiffnessRecord(float(G), float(sd), float(s), (low, high)) for G, sd, s, (low, high) in columns]
    return {names[region]: one for region, one in zip(sorted(names), found, strict=False)}


def _flags(diagnosis: Diagnosis, shown: Refit | None) -> list[str]:
    fit, rules = diagnosis.fit, diagnosis.rules
    untold = misleading_contours(fit)
    out = [f"stiffness: {untold}"] if untold else []
    fits = [("without", fit.linearisation.theta, plain_stiffness(fit)[1])]
    fits += [] if shown is None else [("with", shown.linearisation.theta, shown.covariance)]
    for what, theta, covariance in fits:
        for k, name in bounds_reached(fit, theta, rules).items():
            told = not as_before(np.sqrt(covariance[k, k]), fit.bounds[k : k + 1])[0]
            why = "it may be absorbing an effect" if told else "the scans say next to nothing of it"
            out.append(f"{name}: stiffness at its bound {what} the effect; {why}")
    at = diagnosis.fit.model.surface
    changed = float(
        np.sqrt(
            (diagnosis.fit.model.correction.value[at] ** 2).sum()
            / (len(diagnosis.discrepancy.points) * len(diagnosis.fit.model.each))
        )
    )
    if changed > rules.coarse_mm:
        out.append(
            f"a better element moves the organ's surface by {changed:.2f} mm: the mesh is too coarse for this "
            "deformation, "
            "and the gap may come from it; mesh more finely (--tets)"
        )
    if shown is not None and shown.left_mm > 0.0:
        out.append(
            f"with the effect a better element would move the organ's surface by {shown.left_mm:.2f} mm more: the mesh is too coarse for "
            "it, and what is said of the effect and of the stiffness with it may be wrong by that; mesh more finely (--tets)"
        )
    if not diagnosis.fit.meshes:
        out.append(
            "no better element finds an equilibrium here, so that what the mesh is wrong by is not known but allowed "
            "for; "
            "mesh more finely (--tets)"
        )
    if diagnosis.test.detected and diagnosis.verdict.verdict == AMBIGUOUS and not diagnosis.refits:
        out.append("no effect could be refitted")
    return out
