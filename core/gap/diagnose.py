"""The diagnosis of one case: is there a gap, which effect, where, how far it shrinks. Numbers in, numbers out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from palpate.core.fem.sensitivity import factorise_at
from palpate.core.fem.state import State
from palpate.core.gap.confirm import Refit, refit
from palpate.core.gap.detect import GapTest, gap_test
from palpate.core.gap.effects import Effect, Surroundings
from palpate.core.gap.effects.base import Vector
from palpate.core.gap.evidence import projected, saturated
from palpate.core.gap.forces import ForceFields
from palpate.core.gap.heldout import Gain, Linear, Split, gain
from palpate.core.gap.pairs import JOINED, refit_pairs
from palpate.core.gap.placebo import moved_gains, placebo_gains
from palpate.core.gap.plain import PlainFit, fit_plain
from palpate.core.gap.pressure_fields import pressure_fields
from palpate.core.gap.screen import Screened, screen
from palpate.core.gap.verdict import REMAINDER_LEVEL, Judged, Verdict, decide, probabilities
from palpate.core.gap.where import Where, look
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.worker.progress import Progress, part, silent

FloatArray = NDArray[np.float64]

# Effects whose linear evidence is further below the best than this are not refitted.
_HOPELESS = 12.0
# A first look whose p-value is above this is not looked at again.
_CLEAR = 0.3
# Variants of an effect that are refitted, and how close (log evidence) to the best the second must be.
_VARIANTS, _CLOSE = 3, 3.0


@dataclass(frozen=True, eq=False)
class CaseData:
    """What a diagnosis sees of a case. bones : their surfaces at rest and deformed. gravity : m/s2 as stated, None when unknown."""

    problem: IdentificationProblem
    bones: SurfacePair | None = None
    gravity: tuple[Vector | None, Vector | None] = (None, None)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was found; `palpate.core.gap.record` writes it down.

    refits : best first. gains : of each refit, by effect id; placebo : median share gained by placebos of the best one's size.
    """

    fit: PlainFit
    test: GapTest
    screened: Sequence[Screened]
    refits: Sequence[Refit]
    verdict: Verdict
    where: Where
    split: Split
    left_out: Mapping[str, FloatArray]
    gains: Mapping[str, Gain]
    ceiling: Gain
    placebo: float


def diagnose(data: CaseData, effects: Mapping[str, Effect], progress: Progress = silent, seed: int = 1) -> Diagnosis:
    """Diagnose a case. Raises InputError for a problem that cannot be posed, ConvergenceError when nothing can be solved."""
    fit = fit_plain(data.problem, data.bones, progress=part(progress, 0.0, 0.45))
    _factorise(fit)
    forces = ForceFields.around(fit.point, fit.bench.sight)
    r, J, R = (fit.weighting.whiten(x) for x in (fit.point.residual, fit.point.in_theta, forces.response))
    progress(0.46, "score test of every effect")
    stage, point = fit.bench.stage, fit.point
    around = Surroundings(data.problem, data.gravity, lambda: pressure_fields(stage, point.scene, point.theta))
    screened = sorted(screen(fit, effects, around), key=lambda s: -s.log_evidence)
    named = [(fit.weighting.whiten(S), s.effect.scales) for s in screened for S in s.directions]
    test = gap_test(r, J, R, named, seed)
    refits = [] if test.p_value > _CLEAR else _refits(fit, screened, part(progress, 0.6, 0.9))
    if refits and not test.detected:
        test = gap_test(r, J, R, named, seed, refits[0].log_evidence)
    progress(0.92, "prediction of what was left out")
    where = look(fit, forces)
    return _judged(fit, test, screened, refits if test.detected else [], where, forces, saturated(r, J, R)[0], seed)


def _factorise(fit: PlainFit) -> None:
    scene, found = fit.point.scene, fit.point.equilibrium
    scene.assembler.set_materials(scene.materials(fit.point.theta))
    factorise_at(scene.assembler, State(found.u, found.p))


def _refits(fit: PlainFit, screened: Sequence[Screened], progress: Progress) -> list[Refit]:
    """Effects refitted in full, best first."""
    worth = [s for s in screened if s.log_evidence > screened[0].log_evidence - _HOPELESS or s.tried == 1]
    out = []
    for k, s in enumerate(worth):
        progress(k / len(worth), f"refit with {s.effect.id}")
        near = [i for i, sc in enumerate(s.scores[:_VARIANTS]) if sc.log_evidence > s.scores[0].log_evidence - _CLOSE]
        found = [f for f in (refit(fit, s, i) for i in near) if f is not None]
        if found:
            out.append(max(found, key=lambda f: f.log_evidence))
    return sorted(out, key=lambda f: -f.log_evidence)


def _judged(
    fit: PlainFit,
    test: GapTest,
    screened: Sequence[Screened],
    refits: Sequence[Refit],
    where: Where,
    forces: ForceFields,
    unknown: float,
    seed: int,
) -> Diagnosis:
    split = Split.of(fit)
    plain = plain_model(fit)
    models = {"": plain, "ceiling": _saturated_model(plain, forces)}
    models |= {f.trial.effect.id: _effect_model(f) for f in refits if f.trial.effect is not None}
    left_out = dict(zip(models, split.left_out(list(models.values())), strict=True))
    before = left_out[""]
    gains = {name: gain(split, before, after) for name, after in left_out.items()}
    ceiling = gains.pop("ceiling")
    gains.pop("")
    judged, placebo = [], 0.0
    by_id = {s.effect.id: s for s in screened}
    for rank, f in enumerate(refits):
        assert f.trial.effect is not None
        g = gains[f.trial.effect.id]
        p = 1.0
        if rank < 3:
            placebos = placebo_gains(split, plain, before, forces, _size(fit, f), seed)
            p = _share_as_good(placebos, g)
            variant, screen_of = f.trial.variant, by_id[f.trial.effect.id]
            if variant is not None and variant.where is not None:
                p = max(p, _share_as_good(moved_gains(split, plain, before, screen_of, variant.where), g))
            placebo = float(np.median([q.share for q in placebos])) if rank == 0 else placebo
        share = g.mean_mm2 / ceiling.mean_mm2 if ceiling.mean_mm2 > 0.0 else 1.0
        remainder = fit.weighting.whiten(f.point.residual)
        J = fit.weighting.whiten(np.hstack([f.point.in_theta, f.in_phi]))
        p_left = gap_test(remainder, J, fit.weighting.whiten(forces.response), seed=seed).p_value
        cosine = _imitation(fit, refits[0], f)
        judged.append(Judged(f.trial.effect.id, f.log_evidence, g, p, share, p_left, cosine))
    pairs = refit_pairs(fit, screened, refits) if judged and judged[0].remainder_p < REMAINDER_LEVEL else []
    pair = None if not pairs or pairs[0].trial.effect is None else (pairs[0].trial.effect.id, pairs[0].log_evidence)
    verdict = decide(test.detected, judged, unknown, None if pair is None else (tuple(pair[0].split(JOINED)), pair[1]))
    if not refits:  # nothing was refitted: what the first look says of each effect, had there been a gap
        verdict = replace(verdict, probability=probabilities({s.effect.id: s.log_evidence for s in screened}, unknown))
    return Diagnosis(fit, test, screened, refits, verdict, where, split, left_out, gains, ceiling, placebo)


def _share_as_good(placebos: Sequence[Gain], g: Gain) -> float:
    return float(np.mean([q.mean_mm2 >= g.mean_mm2 for q in placebos])) if placebos else 0.0


def _imitation(fit: PlainFit, best: Refit, other: Refit) -> float:
    """Cosine between the change that the best effect makes, the stiffness projected out, and its image in the other's directions."""
    J = fit.weighting.whiten(best.point.in_theta)
    done = projected(J, fit.weighting.whiten(best.in_phi @ best.phi))
    could = projected(J, fit.weighting.whiten(other.in_phi))
    left = projected(could, done)
    length = max(float(done @ done), 1e-30)
    return float(np.sqrt(max(1.0 - float(left @ left) / length, 0.0)))


def _size(fit: PlainFit, found: Refit) -> float:
    """rms change of the data vector, mm, that the effect makes where it fits best."""
    k = fit.bench.sight.n_modes
    change = (found.point.residual - fit.point.residual)[:k]
    return float(np.sqrt((change**2).sum() / len(found.point.residual)))


def plain_model(fit: PlainFit) -> Linear:
    """The plain model around its fit."""
    t = fit.point.in_theta.shape[1]
    return Linear(fit.point.residual, fit.point.in_theta, np.zeros(t), np.full(t, 1e-4))


def _saturated_model(plain: Linear, forces: ForceFields) -> Linear:
    k = forces.response.shape[1]
    return replace(
        plain,
        J=np.hstack([plain.J, forces.response]),
        value=np.zeros(plain.J.shape[1] + k),
        precision=np.concatenate([plain.precision, np.ones(k)]),
    )


def _effect_model(found: Refit) -> Linear:
    assert found.trial.effect is not None
    t, scales = len(found.point.theta), found.trial.effect.scales
    return Linear(
        found.point.residual,
        np.hstack([found.point.in_theta, found.in_phi]),
        np.concatenate([np.zeros(t), found.phi]),
        np.concatenate([np.full(t, 1e-4), 1.0 / scales**2]),
    )
