"""A body's diagnosis in the form of diagnosis.json, piece by piece."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from msgspec import UNSET, structs

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.fit import BodyFit
from palpate.core.diagnose.bench_bodies.judge import BodyDiagnosis, rms_mm
from palpate.core.diagnose.bench_bodies.model import state_model
from palpate.core.diagnose.bench_bodies.problem import BodyPatch, BodyProblem
from palpate.core.diagnose.detection.gap_test import GapTest
from palpate.core.diagnose.diagnosis_record import (
    FittedStiffnessRecord,
    GapRecord,
    MarkersRecord,
    ReactionRecord,
    RegionGapRecord,
    RemainderRecord,
    ShrinkageRecord,
)
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.verdict.judge import effect_id
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, NONE
from palpate.core.forward.composition import PerAxis
from palpate.core.inference.posterior import unknown
from palpate.core.residual.linearised_model import Hypothesis
from palpate.core.statistics import rms


def by_state(base: BodyFit, one: Refit | None = None) -> list[FloatArray]:
    """Residuals (k, 3) mm of every state's markers, NaN where not seen, of the plain model or with an effect."""
    return base.missed((base.plain if one is None else one).linearisation.residual)


def distances(missed: FloatArray) -> FloatArray:
    """Distance (k,) mm of every marker along the axes seen; missed (k, 3) mm, NaN where not seen."""
    return np.sqrt(np.nansum(missed**2, axis=1))


def gap(base: BodyFit, test: GapTest) -> GapRecord:
    """The "gap" of diagnosis.json."""
    distance = np.concatenate([distances(r) for r in by_state(base)])
    variance = np.diag(base.plain.weighting.covariance)
    parts = zip(base.data, base.plain.model.rows, strict=True)
    noise = sum(float(variance[rows.start : rows.start + d.n_seen].sum()) for d, rows in parts)
    return GapRecord(
        rms_mm=rms(distance),
        p95_mm=float(np.quantile(distance, 0.95)),
        noise_floor_mm=float(np.sqrt(noise / len(distance))),
        detected=test.detected,
        p_value=test.p_value,
        statistic=test.log_factor,
    )


def regions(base: BodyFit) -> list[RegionGapRecord]:
    """Markers by state."""
    missed = by_state(base)
    total = max(sum(float(np.nansum(r**2)) for r in missed), 1e-30)
    return [
        RegionGapRecord(s.name, "all", rms_mm(r), float(np.nansum(r**2)) / total)
        for s, r in zip(base.problem.states, missed, strict=True)
    ]


def plain_stiffness(base: BodyFit) -> dict[str, FittedStiffnessRecord]:
    """Shear modulus G of the body without an effect, see `stiffness`."""
    posterior = base.plain.posterior
    return stiffness(float(posterior.mean[0]), float(posterior.sd[0]))


def flags(base: BodyFit) -> list[str]:
    """A line where the states do not tell the stiffness, which then says nothing of an effect either."""
    if not unknown(base.plain.posterior).all():
        return []
    return [
        "these states tell nothing of the stiffness, whose interval is that which was allowed: a body that is displaced alone "
        "moves alike whatever its stiffness; measure a force, or let a known load act"
    ]


def stiffness(ln_G: float, sd: float) -> dict[str, FittedStiffnessRecord]:
    """Shear modulus G of the body with its standard deviation, kPa, and that of ln G."""
    G = float(np.exp(ln_G))
    return {"body": FittedStiffnessRecord(G, G * float(np.sinh(sd)), sd)}


def stiffness_with(one: Refit) -> dict[str, FittedStiffnessRecord]:
    """The same with an effect."""
    return stiffness(float(one.linearisation.theta[0]), float(np.sqrt(one.covariance[0, 0])))


def gains_mm(found: BodyDiagnosis) -> dict[str, float]:
    """rms that every effect gains on the states left out, mm; none where there is one state."""
    before = found.foretold_mm("")
    if before is None:
        return {}
    each = {name: found.foretold_mm(name) for name in found.left_out if name}
    return {name: rms(before) - rms(after) for name, after in each.items() if after is not None}


def shrinkage(found: BodyDiagnosis, best: Refit) -> ShrinkageRecord | None:
    """Shrinkage of the misfit on states left out of the fit; None where there is only one state."""
    every, each = found.foretold_mm(""), found.foretold_mm(effect_id(best))
    if every is None or each is None:
        return None
    before, after = rms(every), rms(each)
    fraction = 1.0 - after / max(before, 1e-30)
    low, high = np.quantile(1.0 - each / every, [0.0, 1.0]).tolist()
    return ShrinkageRecord(
        held_out_rms_before_mm=before,
        held_out_rms_after_mm=after,
        fraction=fraction,
        noise_corrected_fraction=fraction,
        ci95=(low, high),
        ceiling_fraction=1.0,
        placebo_fraction=0.0,
        effect=effect_id(best),
    )


def states(found: BodyDiagnosis, best: Refit | None) -> list[MarkersRecord]:
    """Every state's misfit, mm, before and after, fitted and predicted from the others; and its reaction forces."""
    base, out = found.base, []
    before = by_state(base)
    after = None if best is None else by_state(base, best)
    left = [None if best is None else found.foretold_mm(name) for name in ("", "" if best is None else effect_id(best))]
    for k, state in enumerate(base.problem.states):
        record = MarkersRecord(
            name=state.name,
            rms_before_mm=rms_mm(before[k]),
            markers=len(state.rest),
            noise_mm=_noise_mm(base, k),
            reactions=_reactions(base, best, k) or UNSET,
        )
        if after is not None:
            one, other = (None if rows is None else float(rows[k]) for rows in left)
            record = structs.replace(
                record, rms_after_mm=rms_mm(after[k]), held_out_before_mm=one, held_out_after_mm=other
            )
        out.append(record)
    return out


def _noise_mm(base: BodyFit, state: int) -> float:
    """What noise would leave of a state's markers, mm rms."""
    rows, data = base.plain.model.rows[state], base.data[state]
    variance = np.diag(base.plain.weighting.covariance)[rows.start : rows.start + data.n_seen]
    return float(np.sqrt(variance.sum() / len(data.seen)))


def _reactions(base: BodyFit, best: Refit | None, state: int) -> list[ReactionRecord]:
    """Reaction forces of a state, N: measured, and predicted without and with the best effect."""
    rows, data = base.plain.model.rows[state], base.data[state]
    first = rows.start + data.n_seen
    out, k = [], first
    for patch in base.problem.patches_in(state):
        for axis, (force, sd) in enumerate(zip(patch.facts.reaction_n, patch.facts.reaction_sd_n, strict=True)):
            if force is None or sd is None:
                continue
            off = [None if f is None else f.linearisation.residual[k] for f in (base.plain, best)]
            values = [None if r is None else force + float(r) for r in off]
            out.append(ReactionRecord(patch.facts.name, "xyz"[axis], force, sd, *values))
            k += 1
    return out


def remainder(base: BodyFit, named: Refit) -> RemainderRecord:
    """Misfit of each state's markers with the named effect, mm rms. Two causes at once are a verdict of their own, so that no second one
    is ever told here."""
    missed = zip(base.problem.states, by_state(base, named), strict=True)
    return RemainderRecord({s.name: rms_mm(r) for s, r in missed}, None)


def next_state(base: BodyFit, best: Refit) -> str | None:
    """Sentence on the further load or displacement under which both models' markers differ most, in mm rms."""
    last = len(base.problem.states) - 1
    moved = bool(base.problem.states[last].loads) or any(p.facts.state == last for p in base.problem.patches)
    differences = []
    for factor, words in ((0.0, "no load"), (2.0, "twice the load")) if moved else ():
        asked = state_model(
            _scaled(base.problem, last, factor), last, base.element, base.options.noise_model.markers_common
        )
        predicted = []
        for at, hypothesis in ((base.plain.linearisation, Hypothesis()), (best.linearisation, best.hypothesis)):
            solved = asked.solve(hypothesis, at.theta, at.phi, None)
            predicted.append(None if solved is None else asked.marker_data.markers.motion(solved.equilibrium.u))
        if predicted[0] is not None and predicted[1] is not None:
            differences.append((rms_mm(predicted[0] - predicted[1]), words))
    if len(differences) < 2:
        return None
    (first, one), (second, other) = sorted(differences, reverse=True)
    return (
        f"a further load: with {one} the models' markers differ by {first:.1f} mm (with {other} by {second:.1f} mm), "
        f"which tells {effect_id(best).replace('_', ' ')} from another stiffness"
    )


def _scaled(problem: BodyProblem, state: int, factor: float) -> BodyProblem:
    """The problem with a state's loads and displacements times a factor."""
    loads = tuple(
        replace(load, force_n=(factor * load.force_n[0], factor * load.force_n[1], factor * load.force_n[2]))
        for load in problem.states[state].loads
    )
    states = list(problem.states)
    states[state] = replace(states[state], loads=loads)
    return replace(problem, states=tuple(states), patches=tuple(_moved(p, state, factor) for p in problem.patches))


def _moved(patch: BodyPatch, state: int, factor: float) -> BodyPatch:
    if patch.facts.state != state:
        return patch
    x, y, z = (None if value is None else factor * value for value in patch.facts.displacement_mm)
    displacement: PerAxis = (x, y, z)
    return replace(patch, facts=replace(patch.facts, displacement_mm=displacement))


def words(base: BodyFit, verdict: str, named: Refit | None) -> str:
    """Sentence that sums up the diagnosis for a reader."""
    missed = rms(np.concatenate([distances(r) for r in by_state(base)]))
    start = f"The plain model misses the markers by {missed:.2f} mm"
    if verdict == NONE:
        return f"{start}, no more than their own error."
    if named is None:
        return (
            f"{start}; these states cannot tell why."
            if verdict == AMBIGUOUS
            else f"{start}; nothing in the library explains it."
        )
    left = rms(np.concatenate([distances(r) for r in by_state(base, named)]))
    assert named.hypothesis.effect is not None
    return f"{start}, because {named.hypothesis.effect.words}; with it the states are missed by {left:.2f} mm."


def maps(base: BodyFit, best: Refit | None) -> dict[str, FloatArray]:
    """Arrays of the body for pictures: its surface, and by state (state_1/) markers, what is missed, and the motion.

    points (n, 3) mm, faces (f, 3); rest, moved (k, 3) mm as seen; residual, residual_after (k, 3) mm, predicted minus seen, NaN where
    not seen; displacement (n, 3) mm of the model with the best effect, without one where there is none.
    """
    mesh = base.problem.mesh
    out = {"points": mesh.points, "faces": mesh.boundary[0].astype(np.float64)}
    before = by_state(base)
    after = None if best is None else by_state(base, best)
    each = (base.plain if best is None else best).linearisation.each
    for k, state in enumerate(base.problem.states):
        at = f"state_{k + 1}/"
        out |= {f"{at}rest": np.array(state.rest), f"{at}moved": base.data[k].moved, f"{at}residual": before[k]}
        out[f"{at}displacement"] = each[k].equilibrium.u[: len(mesh.points)]
        if after is not None:
            out[f"{at}residual_after"] = after[k]
    return out
