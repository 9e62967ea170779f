"""Score test and linear evidence of every effect, from one back-substitution per parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.forward.effect import Effect, Surroundings, Variant
from palpate.core.inference.evidence import Directions, Score, mean_of_exponentials, score
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.linearised_model import Hypothesis
from palpate.core.residual.plain_fit import PlainFit


@dataclass(frozen=True, eq=False)
class Screened:
    """An effect after the score test: its variants, best first, with their scores and directions S (n, k).

    log_evidence : against the plain model, the mean over all variants. paid : what a pair of effects pays for being one choice of
    the variants of both, in the logarithm.
    """

    effect: Effect
    variants: list[Variant]
    scores: list[Score]
    directions: list[FloatArray]
    log_evidence: float
    paid: float = 0.0

    @property
    def linear(self) -> list[Directions]:
        """What each variant adds to the plain model, linear about it."""
        return [Directions.at_zero(S, self.effect.scales, self.effect.bounds) for S in self.directions]

    def weighed(self, evidence: FloatArray) -> Screened:
        """The same, its variants ordered by their log evidence (v,) averaged over the noise."""
        order = np.argsort(-evidence, kind="stable")
        scores = [replace(self.scores[k], log_evidence=float(evidence[k])) for k in order]
        variants, directions = [self.variants[k] for k in order], [self.directions[k] for k in order]
        return Screened(self.effect, variants, scores, directions, mean_of_exponentials(evidence), self.paid)

    @property
    def tried(self) -> int:
        """Number of variants."""
        return len(self.variants)


def screen(fit: PlainFit, effects: Mapping[str, Effect], around: Surroundings) -> list[Screened]:
    """Every effect that the case does not exclude."""
    r = fit.weighting.whiten(fit.linearisation.residual)
    J = fit.weighting.whiten(fit.linearisation.in_theta)
    out = []
    for one in effects.values():
        effect = one.over(len(fit.model.each))
        variants = effect.variants(around)
        if not variants:
            continue
        at = _at_zero(fit, effect)
        directions = [fit.model.directions(Hypothesis(effect, v), at) for v in variants]
        scores = [score(r, J, fit.weighting.whiten(S), effect.scales, effect.bounds) for S in directions]
        order = np.argsort([-s.log_evidence for s in scores], kind="stable")
        total = mean_of_exponentials(np.array([s.log_evidence for s in scores]))
        out.append(
            Screened(
                effect, [variants[i] for i in order], [scores[i] for i in order], [directions[i] for i in order], total
            )
        )
    return out


def _at_zero(fit: PlainFit, effect: Effect) -> JointLinearisation:
    """The plain linearisation as one of the effect's model at phi = 0."""
    return fit.linearisation.with_phi(np.zeros(len(effect.parameters)))
