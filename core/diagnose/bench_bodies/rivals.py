"""Effects that a body's states may ask for: score test, refits, and prediction of every state from the others."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.fit import Added, BodyFit, fit_body, weighting
from palpate.core.diagnose.bench_bodies.problem import BodyProblem
from palpate.core.diagnose.effects import Effect, Surroundings
from palpate.core.inference.evidence import mean_of_exponentials, score
from palpate.core.worker.progress import Progress

# Effects that act through what a bench body does not have: neighbours, walls, contours.
NOT_ON_A_BENCH = ("contour_bias", "interface_sliding", "prestress", "tissue_stiffening", "tissue_heterogeneity")
# Resolution: places where an effect could be are this far apart, over the cube root of the body's volume.
_SPACING = 0.6


class BodySurroundings(Surroundings):
    """Places in a body whose size is not an organ's."""

    def spread_points(self, candidates: FloatArray, spacing_mm: float) -> FloatArray:
        """As `Surroundings.spread_points`, wider apart in a large body."""
        size = float(self.problem.mesh.volumes.sum()) ** (1.0 / 3.0)
        return super().spread_points(candidates, max(spacing_mm, _SPACING * size))


@dataclass(frozen=True, eq=False)
class Rival:
    """Effect refitted to all states.

    log_evidence : against the base model, averaged over the effect's places. p_value : of the fall in weighted squares.
    left_out (states, 2) mm rms : error of every state's markers predicted from the other states, by the base model and
    with the effect; NaN where there are no other states.
    """

    effect: Effect
    fit: BodyFit
    log_evidence: float
    p_value: float
    left_out: FloatArray

    @property
    def predicts(self) -> bool:
        """Whether prediction from the other states improves for every state.

        The summed squares must also fall by more than `DecisionRules.gain_share`.
        """
        before, after = np.square(self.left_out).T
        allowed_share = 1.0 - self.fit.model.solver.options.decision_rules.gain_share
        return bool(np.isfinite(before).all() and (after < before).all() and after.sum() < allowed_share * before.sum())


def rivals(base: BodyFit, effects: Mapping[str, Effect], progress: Progress) -> list[Rival]:
    """Refits of the base model with each effect that a body can have, best first.

    Skipped where the score test's log evidence is `DecisionRules.bench_hopeless` below the best one's.
    """
    rules = base.model.solver.options.decision_rules
    taken = {a.effect.id for a in base.model.added}
    asked = [e for e in effects.values() if e.id not in taken and e.id not in NOT_ON_A_BENCH]
    looks = []
    for k, effect in enumerate(asked):
        progress(0.4 * k / len(asked), f"score test of {effect.id}")
        looks.append((effect, *_first_look(base, effect)))
    top = max((best for _, _, best, _ in looks), default=0.0)
    out = []
    for k, (effect, added, best, spread) in enumerate(looks):
        progress(0.4 + 0.6 * k / len(looks), f"refit with {effect.id}")
        if added is not None and best > top - rules.bench_hopeless:
            rival = _refitted(base, effect, added, spread)
            out += [] if rival is None else [rival]
    return sorted(out, key=lambda f: -f.log_evidence)


def _first_look(base: BodyFit, effect: Effect) -> tuple[Added | None, float, float]:
    """Likeliest variant, log evidence of the effect (mean over variants), and that less the best variant's."""
    problem = base.model.solver.problem
    states = [_variants(problem, effect, k) for k in range(len(problem.states))]
    if not states or len({len(v) for v in states}) != 1 or not states[0]:
        return None, -np.inf, 0.0
    weight = weighting(base.model.solver, base.which)
    r, J = weight.whiten(base.residual), weight.whiten(base.jacobian)
    scores = []
    for variants in zip(*states, strict=True):
        model = replace(base.model, added=(*base.model.added, Added(effect, variants)))
        x = np.concatenate([base.x, np.zeros(len(effect.parameters))])
        linearised = model.linearised(x, base.which)
        S = (
            np.zeros((len(r), len(effect.parameters)))
            if linearised is None
            else weight.whiten(linearised[1][:, len(base.x) :])
        )
        scores.append((score(r, J, S, np.ones(S.shape[1])).log_evidence, Added(effect, variants)))
    logs = np.array([s for s, _ in scores])
    mean = mean_of_exponentials(logs)
    return scores[int(np.argmax(logs))][1], mean, mean - float(logs.max())


def _variants(problem: BodyProblem, effect: Effect, state: int) -> list:  # type: ignore[type-arg]
    gravity = problem.states[state].gravity
    modelled = gravity if problem.model_gravity else (0.0, 0.0, 0.0)
    around = BodySurroundings(problem.shell, (modelled, gravity), density_kg_m3=problem.density_kg_m3)
    return effect.variants(around)


def _refitted(base: BodyFit, effect: Effect, added: Added, spread: float) -> Rival | None:
    model = replace(base.model, added=(*base.model.added, added))
    start = np.concatenate([base.x, np.full(len(effect.parameters), 0.3)])
    fits = [f for f in (fit_body(model, base.which, start * [1.0, *sign]) for sign in _signs(effect, start)) if f]
    if not fits:
        return None
    best = min(fits, key=lambda f: f.cost)
    states = base.model.solver.problem.states
    left_out = np.full((len(states), 2), np.nan)
    if len(states) > 1:
        for k in range(len(states)):
            left_out[k] = [_predicted(f, k) for f in (base, best)]
    drop = _squares(base) - _squares(best)
    p = float(stats.chi2.sf(max(drop, 0.0), len(effect.parameters)))
    return Rival(effect, best, best.log_evidence(base) + spread, p, left_out)


def _signs(effect: Effect, start: FloatArray) -> list[FloatArray]:
    """Starts on either side of zero, where both are allowed."""
    one = np.ones(len(start) - 1)
    other = one.copy()
    other[-len(effect.parameters) :] *= -1.0
    return [one, other]


def _squares(fit: BodyFit) -> float:
    return weighting(fit.model.solver, fit.which).squared(fit.residual)


def _predicted(fit: BodyFit, left_out: int) -> float:
    """Error (rms, mm) of a state's markers predicted by the model fitted to the other states; inf without a fit."""
    others = [k for k in fit.which if k != left_out]
    refit = fit_body(fit.model, others, fit.x)
    linearised = None if refit is None else fit.model.linearised(refit.x, [left_out])
    return np.inf if linearised is None else marker_rms(linearised[0])


def marker_rms(residual: FloatArray) -> float:
    """Root mean square distance of markers, mm, from residuals (3 k,)."""
    return float(np.sqrt((residual.reshape(-1, 3) ** 2).sum(axis=1).mean()))
