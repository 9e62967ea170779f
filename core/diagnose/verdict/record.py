"""A diagnosis in the form of diagnosis.json."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.detection.location import DiscrepancyMaps, look, regions, residuals
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.diagnosis_record import (
    DecidedByRecord,
    DiagnosisRecord,
    FittedStiffnessRecord,
    GapRecord,
    ParameterRecord,
    RankedRecord,
    StateGapRecord,
    StiffnessRecord,
    WhereRecord,
)
from palpate.core.diagnose.options import DiagnosisOptions
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.averaged_stiffness import averaged_stiffness, plain_stiffness
from palpate.core.diagnose.verdict.judge import Diagnosis, tempered
from palpate.core.diagnose.verdict.shrinkage import shrinkage
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE, UNKNOWN
from palpate.core.diagnose.verdict.words import next_measurement, sentence
from palpate.core.residual.linearised_model import Linearisation
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.statistics import rms

MAP_FILE = "gap_maps.npz"


def record(found: Diagnosis, case: str) -> DiagnosisRecord:
    """diagnosis.json for a case of this name."""
    best = found.refits[0] if found.refits else None
    shown = best if found.verdict.verdict not in (NONE, UNKNOWN) else None
    names = dict(found.fit.bench.first.plain.problem.region_names)
    return DiagnosisRecord(
        case=case,
        gap=_gap(found),
        where=WhereRecord(
            map=MAP_FILE,
            regions=regions(found.where, names),
            peak_lps_mm=_peak(found),
            blur_mm=found.where.blur_mm,
        ),
        verdict=found.verdict.verdict,
        candidates=list(found.verdict.candidates),
        ranking=_ranking(found),
        shrinkage=shrinkage(found, best) if best is not None else None,
        stiffness=StiffnessRecord(
            without_effect=_stiffness(found, *plain_stiffness(found.fit, found.rules)),
            with_effect=None if shown is None else _stiffness(found, *averaged_stiffness(found)),
        ),
        next_measurement=next_measurement(found),
        why=found.verdict.why,
        decided_by=DecidedByRecord(found.verdict.decided_by, found.verdict.why),
        in_words=sentence(found),
        probability_unknown=found.verdict.probability.get(UNKNOWN, 0.0),
        flags=_flags(found, shown),
        options=_options(found),
    )


def _options(found: Diagnosis) -> DiagnosisOptions:
    """The numbers in force."""
    walls = found.fit.bench.first.stage.walls
    return DiagnosisOptions(noise_model=found.fit.options, wall_motion=walls, decision_rules=found.rules)


def _peak(found: Diagnosis) -> tuple[float, float, float] | None:
    """Where the gap comes from: the place of the likeliest effect if it has one, else where the missing force is largest."""
    for fitted in found.refits:
        effect, variant = fitted.trial.effect, fitted.trial.variant
        if effect is None or variant is None or effect.id not in found.verdict.candidates or variant.where is None:
            continue
        names = [p.name for p in effect.parameters]
        shift = [fitted.phi[names.index(f"shift_{axis}")] if f"shift_{axis}" in names else 0.0 for axis in "xyz"]
        return _point(np.asarray(variant.where) + shift)
    return None if found.where.peak is None else _point(found.where.peak)


def _point(x: FloatArray) -> tuple[float, float, float]:
    return float(x[0]), float(x[1]), float(x[2])


def maps(found: Diagnosis) -> dict[str, FloatArray]:
    """Arrays of MAP_FILE: points, normals, residual_mm, standardised (surface); nodes_mm, force_kpa_per_mm (around it).

    predicted/ID (q, 3) mm : where the surface's points go by the plain model ("plain") and by each refitted effect; correction/ID (q,)
    is what better element and other meshes add to that along the normal, offset/ID (1,) by how much the effect has the contour too wide.
    Further deformed states have the same under state_2/ and so on.
    """
    out: dict[str, FloatArray] = {}
    for state in range(len(found.fit.bench.each)):
        where = found.where if state == 0 else look(found.fit, found.forces, found.rules, state)
        out |= {f"{_prefix(state)}{key}": values for key, values in _maps(found, state, where).items()}
    return out


def _prefix(state: int) -> str:
    return f"state_{state + 1}/" if state else ""


def _maps(found: Diagnosis, state: int, where: DiscrepancyMaps) -> dict[str, FloatArray]:
    """Of one deformed state."""
    sight, rows = found.fit.bench.sights[state], found.fit.bench.rows[state]
    models = {"plain": (found.fit.point, found.fit.bench.correction)} | {
        f.trial.effect.id: (f.point, f.correction) for f in found.refits if f.trial.effect is not None
    }
    out: dict[str, FloatArray] = {}
    for name, (points, correction) in models.items():
        point = points.each[state]
        out[f"predicted/{name}"] = _predicted(point)
        out[f"correction/{name}"] = sight.modes @ correction[rows][: sight.n_modes]
        out[f"offset/{name}"] = np.array([point.scene.composition.observation])
    return out | {
        "points": where.points,
        "normals": where.normals,
        "region": where.region.astype(float),
        "residual_mm": where.residual,
        "standardised": where.standardised,
        "nodes": where.nodes,
        "force_kpa_per_mm": where.force,
    }  # fmt: skip


def _predicted(point: Linearisation) -> FloatArray:
    seen = point.scene.observation
    return np.asarray(seen.points + seen.operator @ point.scene.seen(point.equilibrium.u))


def _gap(found: Diagnosis) -> GapRecord:
    fit = found.fit
    left, variances = residuals(fit), _variances(fit)
    residual = np.abs(np.concatenate(left))
    return GapRecord(
        rms_mm=rms(residual),
        p95_mm=float(np.quantile(residual, 0.95)),
        noise_floor_mm=float(np.sqrt(np.mean(variances))),
        detected=found.test.detected,
        p_value=found.test.p_value,
        statistic=found.test.statistic,
        degrees_of_freedom=found.test.freedom,
        p_values={"whole": found.test.p_whole, "smooth": found.test.p_smooth, "named": found.test.p_named},
        contour_noise_sd_mm=found.fit.sizes.contour * fit.point.first.scene.problem.facts.noise_sd_mm,
        contour_noise_correlation_mm=found.fit.sizes.length,
        states=[StateGapRecord(rms(r), float(np.sqrt(variance))) for r, variance in zip(left, variances, strict=True)],
    )


def _variances(fit: PlainFit) -> list[float]:
    """What noise leaves on each state's surface, mm2 on the average."""
    variance = np.diag(fit.weighting.covariance)
    each = zip(fit.bench.rows, fit.bench.sights, strict=True)
    return [float(variance[rows.start : rows.start + sight.n_modes].sum()) / len(sight.modes) for rows, sight in each]


def _ranking(found: Diagnosis) -> list[RankedRecord]:
    """Every effect looked at, most probable first; those not refitted have their linear estimate."""
    refits = {f.trial.effect.id: f for f in found.refits if f.trial.effect is not None}
    rows = [
        (_row(found, s, refits.get(s.effect.id)), _evidence(found, s, refits.get(s.effect.id))) for s in found.screened
    ]
    order = sorted(rows, key=lambda row: -row[0].probability if refits else -row[1])
    return [row for row, _ in order]


def _evidence(found: Diagnosis, screened: Screened, fitted: Refit | None) -> float:
    return tempered(screened.log_evidence if fitted is None else fitted.log_evidence, found.fit.options.short_by)


def _row(found: Diagnosis, screened: Screened, fitted: Refit | None) -> RankedRecord:
    effect, first = screened.effect, screened.scores[0]
    phi = first.estimate if fitted is None else fitted.phi
    sd = np.sqrt(np.diag(first.covariance)) if fitted is None else fitted.sd_phi
    variant = screened.variants[0] if fitted is None else fitted.trial.variant
    gain = found.gains.get(effect.id)
    parameters = {}
    for p, value, error in zip(effect.parameters, phi.tolist(), sd.tolist(), strict=True):
        low, high = (p.physical(float(np.clip(value + s * error, p.low, p.high))) for s in (-1, 1))
        inside = float(np.clip(value, p.low, p.high))
        parameters[p.name] = ParameterRecord(p.physical(inside), abs(high - low) / 2.0, p.unit)
    return RankedRecord(
        effect=effect.id,
        probability=found.verdict.probability.get(effect.id, 0.0),
        residual_share=_residual_share(found, fitted),
        cv_gain_mm=0.0 if gain is None else gain.before_mm - gain.after_mm,
        p_value=min(1.0, first.p_value * screened.tried),
        parameters=parameters,
        variant="" if variant is None else variant.name,
        log_evidence=_evidence(found, screened, fitted),
        refitted=fitted is not None,
    )


def _residual_share(found: Diagnosis, fitted: Refit | None) -> float:
    """Share of the plain model's weighted square residual that is left with the effect."""
    if fitted is None:
        return 1.0
    a, b = (found.fit.weighting.squared(x) for x in (fitted.point.residual, found.fit.point.residual))
    return float(a / max(b, 1e-30))


def _stiffness(found: Diagnosis, theta: FloatArray, covariance: FloatArray) -> dict[str, FittedStiffnessRecord]:
    names = found.fit.bench.first.plain.problem.region_names
    sd = np.sqrt(np.diag(covariance))[: len(theta)]
    return {
        names[r]: FittedStiffnessRecord(float(np.exp(t)), float(np.exp(t) * np.sinh(s)), float(s))
        for r, t, s in zip(sorted(names), theta, sd, strict=True)
    }


def _flags(found: Diagnosis, shown: Refit | None) -> list[str]:
    bounds = found.fit.point.first.scene.parameters.bounds
    names, rules = found.fit.bench.first.plain.problem.region_names, found.rules
    out = []
    fits = [("without", found.fit.point.theta, plain_stiffness(found.fit, found.rules)[1])]
    fits += [] if shown is None else [("with", shown.point.theta, shown.covariance)]
    for what, theta, covariance in fits:
        sd = np.sqrt(np.diag(covariance))[: len(theta)]
        for region, t, s, (low, high) in zip(sorted(names), theta, sd, bounds, strict=True):
            if t < low + rules.at_bound or t > high - rules.at_bound:
                why = "the scans say next to nothing of it" if s > rules.not_told else "it may be absorbing an effect"
                out.append(f"{names[region].replace('_', ' ')}: stiffness at its bound {what} the effect; {why}")
    at = found.fit.bench.surface
    changed = float(np.sqrt((found.fit.mesh[at] ** 2).sum() / (len(found.where.points) * len(found.fit.bench.each))))
    if changed > rules.coarse_mm:
        out.append(
            f"a better element moves the organ's surface by {changed:.2f} mm: the mesh is too coarse for this deformation, "
            "and the gap may come from it; mesh more finely (--tets)"
        )
    if not found.fit.meshes:
        out.append(
            "no better element finds an equilibrium here, so that what the mesh is wrong by is not known but allowed for; "
            "mesh more finely (--tets)"
        )
    if found.verdict.verdict == AMBIGUOUS and not found.refits:
        out.append("no effect could be refitted")
    return out
