"""The plain model of a body, whether its states show a gap, and the answer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from palpate.core.diagnose.bench_bodies.fit import BodyFit, BodyModel, fit_body, weighting
from palpate.core.diagnose.bench_bodies.rivals import Rival
from palpate.core.diagnose.bench_bodies.scene import BodyStage
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, MOST_CANDIDATES, NONE, TIED, UNKNOWN, probabilities
from palpate.core.errors import ConvergenceError
from palpate.core.inference.evidence import projected, score

LEVEL = 0.05
GRAVITY = "gravity_change"
# What an effect that nobody has thought of would do to the markers, mm.
_UNNAMED_MM = 2.0


def base_fit(stage: BodyStage) -> BodyFit:
    """The plain model on all states. Raises ConvergenceError when nothing can be solved."""
    which = range(len(stage.problem.states))
    found = fit_body(BodyModel(stage), which, np.log(stage.problem.bounds_kpa).mean(keepdims=True))
    if found is None:
        raise ConvergenceError(
            "the body has no equilibrium under these loads; look at its supports, loads and stiffness bounds"
        )
    return found


def p_value(fit: BodyFit) -> float:
    """Of the markers' residual under their noise alone."""
    weight = weighting([fit.model.stage.problem.states[k] for k in fit.which])
    return float(stats.chi2.sf(weight.squared(fit.residual), max(len(fit.residual) - len(fit.x), 1)))


def unnamed(base: BodyFit) -> float:
    """Log evidence of a displacement of every state's markers that no effect of the library makes."""
    states = [base.model.stage.problem.states[k] for k in base.which]
    weight = weighting(states)
    r = projected(weight.whiten(base.jacobian), weight.whiten(base.residual))
    S = np.zeros((len(r), 3 * len(states)))
    row = 0
    for k, s in enumerate(states):
        n = 3 * len(s.rest)
        S[row : row + n, 3 * k : 3 * k + 3] = np.tile(np.eye(3), (len(s.rest), 1))
        row += n
    J = weight.whiten(base.jacobian)
    return score(r, J, weight.whiten(S), np.full(S.shape[1], _UNNAMED_MM)).log_evidence


def decide_body(
    base: BodyFit, found: Sequence[Rival], detected: bool
) -> tuple[str, tuple[str, ...], dict[str, float], str]:
    """Verdict, candidates, probabilities and why."""
    probability = probabilities({f.effect.id: f.log_evidence for f in found}, unnamed(base))
    problem = base.model.stage.problem
    known = not problem.model_gravity and any(np.linalg.norm(s.gravity) > 0.1 for s in problem.states)
    if not detected:
        gravity = next((f for f in found if f.effect.id == GRAVITY), None)
        if known and gravity is not None and gravity.log_evidence > -np.log(TIED):
            why = "gravity is known to act and is not in the model, but the stiffness takes its place in these states"
            return AMBIGUOUS, (GRAVITY,), probability, why
        return NONE, (), probability, "what the plain model leaves is no more than the markers' own error"
    top = max((probability[f.effect.id] for f in found), default=0.0)
    tied = [f for f in found if probability[f.effect.id] * TIED >= top]
    if not tied or probability[UNKNOWN] > TIED * top:
        return UNKNOWN, (), probability, "no effect of the library explains the gap as well as something unnamed"
    names = tuple(f.effect.id for f in tied[:MOST_CANDIDATES])
    if len(tied) > 1 or probability[UNKNOWN] * TIED > top:
        return AMBIGUOUS, names, probability, "these effects explain the gap about equally well"
    if not tied[0].predicts:
        return (
            AMBIGUOUS,
            names,
            probability,
            "the effect fits best, but not every state is predicted better from the others",
        )
    return names[0], names, probability, "the effect explains the gap and predicts the states left out"
