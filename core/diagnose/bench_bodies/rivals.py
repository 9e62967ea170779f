"""Effects that a body's states may ask for: score test, refits, and prediction of every state from the others."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.fit import BodyFit, without_state
from palpate.core.diagnose.bench_bodies.kept_work import KeptWork
from palpate.core.diagnose.bench_bodies.on_bench import on_bench
from palpate.core.diagnose.detection.score_test import Screened, screen
from palpate.core.diagnose.effects import Effect, Surroundings
from palpate.core.diagnose.refit.pairs import joined, together
from palpate.core.diagnose.refit.refit import Refit, refit, refit_at, refit_corrected
from palpate.core.diagnose.refit.variants import of_all
from palpate.core.inference.evidence import score
from palpate.core.inference.heldout import Linear
from palpate.core.inference.posterior import prior_precision
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.linearised_model import Hypothesis
from palpate.core.residual.optimum import best_of
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.progress import Progress, part

# Numerical: a refit ends when no parameter moves by more than this (ln G; phi in prior standard deviations). Markers
# tell a stiffness to some percent, so that a tenth of that is asked for.
_TOLERANCE = 5e-3


@dataclass(frozen=True, eq=False)
class Rival:
    """Effect refitted to all states.

    p_value : of the fall in weighted squares. left_out (states, 2) mm rms : error of every state's markers predicted
    from the other states, by the plain model and with the effect; NaN where there are no other states. alone : the
    effect as it was tested alone.
    """

    effect: Effect
    fit: Refit
    alone: Screened
    p_value: float
    left_out: FloatArray
    gain_share: float

    @property
    def log_evidence(self) -> float:
        """Against the plain model, averaged over the effect's places."""
        return self.fit.log_evidence

    @property
    def predicts(self) -> bool:
        """Whether prediction from the other states improves for every state, and the summed squares fall by more than
        `DecisionRules.gain_share`."""
        before, after = np.square(self.left_out).T
        allowed_share = 1.0 - self.gain_share
        return bool(np.isfinite(before).all() and (after < before).all() and after.sum() < allowed_share * before.sum())


def rivals(base: BodyFit, effects: Mapping[str, Effect], kept: KeptWork, progress: Progress) -> list[Rival]:
    """Refits of the plain model with each effect that a body can have, best first.

    Skipped where the score test's log evidence is `DecisionRules.bench_hopeless` below the best one's.
    """
    rules, fit = base.options.decision_rules, base.plain
    progress(0.0, "score test of every effect")
    here = on_bench(effects, base.problem)
    screened = sorted(screen(fit, here, Surroundings(base.problem.shell)), key=lambda s: -s.log_evidence)
    worth = [s for s in screened if s.log_evidence > screened[0].log_evidence - rules.bench_hopeless]
    refits: list[tuple[Screened, Refit]] = []
    for k, s in enumerate(worth):
        one = _refitted(base, s, kept, part(progress, 0.3 + 0.4 * k / len(worth), 0.3 + 0.4 * (k + 1) / len(worth)))
        refits += [] if one is None else [(s, one)]
    refits.sort(key=lambda pair: -pair[1].log_evidence)
    before = _plain_left_out(base, kept, part(progress, 0.7, 0.8)) if len(base.data) > 1 else None
    out = []
    for k, (s, one) in enumerate(refits):
        solved = k < rules.placebo_tested
        told = part(progress, 0.8 + 0.2 * k / len(refits), 0.8 + 0.2 * (k + 1) / len(refits))
        after = _left_out(base, s, one, kept, told, solved) if before is not None else None
        both = np.full((1, 2), np.nan) if before is None or after is None else np.column_stack([before, after])
        drop = squares(fit, fit.linearisation) - squares(fit, one.linearisation)
        p = float(stats.chi2.sf(max(drop, 0.0), len(s.effect.parameters)))
        out.append(Rival(effects[s.effect.id], one, s, p, both, rules.gain_share))
    return out


def squares(fit: PlainFit, at: JointLinearisation) -> float:
    """Weighted squares of a residual."""
    return fit.weighting.squared(at.residual)


def rms_mm(missed: FloatArray) -> float:
    """Root mean square distance of markers, mm, along the axes seen; missed (k, 3) mm, NaN where not seen."""
    return float(np.sqrt(np.nansum(missed**2, axis=1).mean()))


def _refitted(base: BodyFit, screened: Screened, kept: KeptWork, progress: Progress) -> Refit | None:
    """Refit of an effect's best variants; None when the model cannot be solved with any."""
    rules, fit = base.options.decision_rules, base.plain
    first = [s.log_evidence for s in screened.scores[: rules.variants]]
    tried = [k for k, evidence in enumerate(first) if evidence > first[0] - rules.variants_within]
    refits = []
    for count, k in enumerate(tried):
        progress(count / len(tried), f"refit with {screened.effect.id.replace('_', ' ')} {screened.variants[k].name}")
        refits.append(_kept_refit(fit, screened, k, kept, f"refit/{screened.effect.id}/{k}"))
    found = [r for r in refits if r is not None]
    return of_all(found, screened) if found else None


def _kept_refit(fit: PlainFit, screened: Screened, which: int, kept: KeptWork, name: str) -> Refit | None:
    def make() -> JointLinearisation | None:
        made = refit(fit, screened, which, _TOLERANCE)
        return None if made is None else made.linearisation

    place = kept.place(name, make)
    if not place.found:
        return None
    return refit_at(fit, screened, which, place.theta, place.phi, place.on(fit.model))


def _plain_left_out(base: BodyFit, kept: KeptWork, progress: Progress) -> FloatArray:
    """Error (states,) mm rms of every state's markers predicted by the plain model fitted to the others."""
    out, fit = [], base.plain
    for k, state in enumerate(base.problem.states):
        progress(k / len(base.data), f"{state.name} predicted from the other states")

        def make(k: int = k) -> FloatArray:
            rest = base.without(k)
            theta = best_of(rest.model, rest.weighting, fit.linearisation.theta[None], rest.linearisation)
            at = fit.model.each[k].solve(
                Hypothesis(), theta.linearisation.theta, np.zeros(0), fit.linearisation.each[k]
            )
            return np.array([np.inf if at is None else rms_mm(base.data[k].missed(at.residual))])

        out.append(float(kept.numbers(f"left_out/{k}", make)[0]))
    return np.array(out)


def _left_out(
    base: BodyFit, screened: Screened, one: Refit, kept: KeptWork, progress: Progress, solved: bool
) -> FloatArray:
    """The same (states,) with an effect; solved : with the model refitted without the state, else linear around the
    refit."""
    if not solved:
        return np.array([_linear_left_out(base, one, k) for k in range(len(base.data))])
    out = []
    for k, state in enumerate(base.problem.states):
        progress(k / len(base.data), f"{state.name} predicted with {screened.effect.id.replace('_', ' ')}")
        make = _predicted(base, screened, one, k)
        out.append(float(kept.numbers(f"left_out/{screened.effect.id}/{k}", make)[0]))
    return np.array(out)


def _predicted(base: BodyFit, screened: Screened, one: Refit, state: int) -> Callable[[], FloatArray]:
    def make() -> FloatArray:
        rest = base.without(state)
        start = replace(one, linearisation=without_state(one.linearisation, state))
        again = refit_corrected(rest, screened, start, ElementCorrection.none(rest.model.n), _TOLERANCE)
        if again is None:
            return np.array([np.inf])
        theta, phi, near = again.linearisation.theta, again.phi, one.linearisation.each[state]
        at = base.plain.model.each[state].solve(one.hypothesis, theta, phi, near)
        return np.array([np.inf if at is None else rms_mm(base.data[state].missed(at.residual))])

    return make


def linear(fit: PlainFit, one: Refit) -> Linear:
    """Model with an effect, linear around its fit."""
    assert one.hypothesis.effect is not None
    precision = np.concatenate([prior_precision(fit.bounds), 1.0 / one.hypothesis.effect.scales**2])
    value = np.concatenate([np.zeros(len(one.linearisation.theta)), one.phi])
    J = np.hstack([one.linearisation.in_theta, one.in_phi])
    return Linear(one.linearisation.residual, J, value, precision)


def _linear_left_out(base: BodyFit, one: Refit, state: int) -> float:
    model, rows = linear(base.plain, one), base.plain.model.rows[state]
    rest = np.delete(np.arange(len(model.r)), np.arange(rows.start, rows.stop))
    weights = base.without(state).weighting
    r, J = weights.whiten(model.r[rest]), weights.whiten(model.J[rest])
    step = np.linalg.solve(J.T @ J + np.diag(model.precision), J.T @ r + model.precision * model.value)
    return rms_mm(base.data[state].missed(model.r[rows] - model.J[rows] @ step))


def second_cause(base: BodyFit, named: Rival, others: list[Rival], kept: KeptWork) -> Effect | None:
    """Second effect beside the named one, if it passes the same evidence, p-value and prediction tests.

    The likeliest of the other effects at the named one's own fit is refitted together with it.
    """
    rules, fit = base.options.decision_rules, base.plain
    left = stats.chi2.sf(squares(fit, named.fit.linearisation), max(fit.model.n - len(named.fit.covariance), 1))
    pairs = (
        sorted((_beside(fit, named, o) for o in others), key=lambda s: -s.log_evidence) if left < rules.level else []
    )
    if not pairs or pairs[0].log_evidence < np.log(rules.tied):
        return None
    pair = pairs[0]
    start = replace(named.fit, hypothesis=Hypothesis(pair.effect, pair.variants[0]), linearisation=_from(named, pair))
    both = _kept_pair(fit, pair, start, kept)
    if both is None:
        return None
    drop = squares(fit, named.fit.linearisation) - squares(fit, both.linearisation)
    extra = len(pair.effect.parameters) - len(named.effect.parameters)
    gained = both.own_evidence - named.fit.own_evidence + min(pair.log_evidence - pair.scores[0].log_evidence, 0.0)
    if gained < np.log(rules.tied) or stats.chi2.sf(max(drop, 0.0), extra) > rules.level or len(base.data) < 2:
        return None
    after = _left_out(base, pair, both, kept, lambda *_: None, True)
    better = replace(named, left_out=np.column_stack([named.left_out[:, 1], after])).predicts
    other = next(o for o in others if pair.effect.id.endswith(o.effect.id))
    return other.effect if better else None


def _from(named: Rival, pair: Screened) -> JointLinearisation:
    """The named effect's fit as a place of the pair, the second effect at 0."""
    phi = np.zeros(len(pair.effect.parameters))
    phi[: len(named.fit.phi)] = named.fit.phi
    return named.fit.linearisation.with_phi(phi)


def _beside(fit: PlainFit, named: Rival, other: Rival) -> Screened:
    """Score test of another effect where the named one fits, as that of the pair; it pays for its variants."""
    effect = together(named.alone.effect, other.alone.effect)
    first, second = named.fit.hypothesis.variant, other.fit.hypothesis.variant
    assert first is not None and second is not None
    variant = joined(first, second, len(named.alone.effect.parameters))
    hypothesis, k = Hypothesis(effect, variant), len(named.alone.effect.parameters)
    draft = Screened(effect, [variant], [], [], 0.0)
    S = fit.model.directions(hypothesis, _from(named, draft))
    J = np.hstack([named.fit.linearisation.in_theta, S[:, :k]])
    whiten, alone = fit.weighting.whiten, other.alone.effect
    r = whiten(named.fit.linearisation.residual)
    scored = score(r, whiten(J), whiten(S[:, k:]), alone.scales, alone.bounds)
    paid = float(np.log(other.alone.tried))
    return Screened(effect, [variant], [scored], [S], scored.log_evidence - paid)


def _kept_pair(fit: PlainFit, pair: Screened, start: Refit, kept: KeptWork) -> Refit | None:
    def make() -> JointLinearisation | None:
        made = refit_corrected(fit, pair, start, ElementCorrection.none(fit.model.n), _TOLERANCE)
        return None if made is None else made.linearisation

    place = kept.place(f"refit/{pair.effect.id}", make)
    return refit_at(fit, pair, 0, place.theta, place.phi, place.on(fit.model)) if place.found else None
