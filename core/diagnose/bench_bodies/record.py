"""A body's diagnosis in the form of diagnosis.json, piece by piece."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.fit import BodyFit
from palpate.core.diagnose.bench_bodies.rivals import Rival, marker_rms
from palpate.core.diagnose.diagnosis_record import (
    FittedStiffnessRecord,
    GapRecord,
    MarkersRecord,
    ParameterRecord,
    RankedRecord,
    RegionGapRecord,
    RemainderRecord,
    ShrinkageRecord,
)
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE
from palpate.core.statistics import rms


def by_state(fit: BodyFit) -> list[FloatArray]:
    """Residuals (k, 3) mm of every state's markers."""
    ends = np.cumsum([3 * len(fit.model.solver.problem.states[k].rest) for k in fit.which])
    return [r.reshape(-1, 3) for r in np.split(fit.residual, ends[:-1])]


def gap(base: BodyFit, p: float) -> GapRecord:
    """The "gap" of diagnosis.json; p : of the markers under their noise alone."""
    distance = np.linalg.norm(np.vstack(by_state(base)), axis=1)
    noise = [3.0 * base.model.solver.problem.states[k].sd_mm ** 2 for k in base.which]
    return GapRecord(
        rms_mm=rms(distance),
        p95_mm=float(np.quantile(distance, 0.95)),
        noise_floor_mm=float(np.sqrt(np.mean(noise))),
        detected=p < base.model.solver.options.decision_rules.level,
        p_value=p,
    )


def regions(base: BodyFit) -> list[RegionGapRecord]:
    """Markers by state."""
    total = max(float((base.residual**2).sum()), 1e-30)
    names = [s.name for s in base.model.solver.problem.states]
    return [
        RegionGapRecord(n, "all", marker_rms(r.ravel()), float((r**2).sum()) / total)
        for n, r in zip(names, by_state(base), strict=True)
    ]


def stiffness(fit: BodyFit) -> dict[str, FittedStiffnessRecord]:
    """Shear modulus G of the body with its standard deviation, kPa, and that of ln G."""
    G, sd = float(np.exp(fit.x[0])), float(np.sqrt(fit.covariance[0, 0]))
    return {"body": FittedStiffnessRecord(G, G * float(np.sinh(sd)), sd)}


def row(base: BodyFit, f: Rival, probability: float) -> RankedRecord:
    """One row of "ranking"."""
    before, after = (float(np.sqrt(np.square(c).mean())) for c in f.left_out.T)
    names = zip(f.effect.parameters, f.fit.x[-len(f.effect.parameters) :], strict=True)
    sd = np.sqrt(np.diag(f.fit.covariance))[-len(f.effect.parameters) :]
    return RankedRecord(
        effect=f.effect.id,
        probability=probability,
        residual_share=float((f.fit.residual**2).sum() / max((base.residual**2).sum(), 1e-30)),
        cv_gain_mm=before - after if np.isfinite(before) else 0.0,
        p_value=f.p_value,
        parameters={
            p.name: ParameterRecord(p.physical(float(v * p.scale)), float(s * p.scale), p.unit)
            for (p, v), s in zip(names, sd, strict=True)
        },
        variant=f.fit.model.added[-1].variants[0].name,
        log_evidence=f.log_evidence,
        refitted=True,
    )


def shrinkage(best: Rival) -> ShrinkageRecord | None:
    """Shrinkage of the misfit on states left out of the fit; None where there is only one state."""
    if not np.isfinite(best.left_out).all():
        return None
    before, after = (float(np.sqrt(np.square(c).mean())) for c in best.left_out.T)
    fraction = 1.0 - after / max(before, 1e-30)
    low, high = np.quantile(1.0 - best.left_out[:, 1] / best.left_out[:, 0], [0.0, 1.0]).tolist()
    return ShrinkageRecord(
        held_out_rms_before_mm=before,
        held_out_rms_after_mm=after,
        fraction=fraction,
        noise_corrected_fraction=fraction,
        ci95=(low, high),
        ceiling_fraction=1.0,
        placebo_fraction=0.0,
        effect=best.effect.id,
    )


def states(base: BodyFit, best: Rival | None) -> list[MarkersRecord]:
    """Every state's misfit, mm, before and after, fitted and predicted from the others."""
    out = []
    for k, (state, r) in enumerate(zip(base.model.solver.problem.states, by_state(base), strict=True)):
        before = marker_rms(r.ravel())
        if best is None:
            out.append(MarkersRecord(name=state.name, rms_before_mm=before))
            continue
        left_before, left_after = (float(x) if np.isfinite(x) else None for x in best.left_out[k])
        out.append(
            MarkersRecord(
                name=state.name,
                rms_before_mm=before,
                rms_after_mm=marker_rms(by_state(best.fit)[k].ravel()),
                held_out_before_mm=left_before,
                held_out_after_mm=left_after,
            )
        )
    return out


def remainder(named: BodyFit, cause: Rival | None) -> RemainderRecord:
    """Misfit of each state's markers with the named effect, mm rms, and a second cause where one passes."""
    names = [s.name for s in named.model.solver.problem.states]
    rms_mm = {n: marker_rms(r.ravel()) for n, r in zip(names, by_state(named), strict=True)}
    return RemainderRecord(rms_mm, None if cause is None else cause.effect.id)


def next_state(base: BodyFit, best: Rival) -> str:
    """Sentence on the further load under which both models' markers differ most, in mm rms."""
    problem = base.model.solver.problem
    differences = []
    for factor, words in ((0.0, "no load"), (2.0, "twice the load")):
        loads = tuple(
            replace(load, force_n=(factor * load.force_n[0], factor * load.force_n[1], factor * load.force_n[2]))
            for load in problem.states[-1].loads
        )
        asked = replace(problem.states[-1], name=words, loads=loads)
        moved = []
        for fit in (base, best.fit):
            at = fit.model.solver.solve(fit.model.composition(fit.x, len(problem.states) - 1), fit.x[:1], asked)
            moved.append(fit.model.solver.markers(at.u, asked))
        differences.append((marker_rms((moved[0] - moved[1]).ravel()), words))
    (first, one), (second, other) = sorted(differences, reverse=True)
    return (
        f"a further load: with {one} the models' markers differ by {first:.1f} mm (with {other} by {second:.1f} mm), "
        f"which tells {best.effect.id.replace('_', ' ')} from another stiffness"
    )


def words(base: BodyFit, verdict: str, named: Rival | None) -> str:
    """Sentence that sums up the diagnosis for a reader."""
    missed = rms(np.linalg.norm(np.vstack(by_state(base)), axis=1))
    start = f"The plain model misses the markers by {missed:.2f} mm"
    if verdict == NONE:
        return f"{start}, no more than their own error."
    if named is None:
        return (
            f"{start}; these states cannot tell why."
            if verdict == AMBIGUOUS
            else f"{start}; nothing in the library explains it."
        )
    return (
        f"{start}, because {named.effect.words}; "
        f"with it the states are missed by {marker_rms(named.fit.residual):.2f} mm."
    )
