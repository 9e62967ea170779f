"""Pairs of effects: the most probable effect with each of the others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.effects import Effect, Variant
from palpate.core.diagnose.posterior import JOINED, posterior
from palpate.core.diagnose.refit.refit import Refit, refit_corrected
from palpate.core.diagnose.refit.variants import capped
from palpate.core.forward.composition import Composition
from palpate.core.inference.evidence import Directions, score
from palpate.core.inference.posterior import prior_precision
from palpate.core.residual.joint_states import JointLinearisation
from palpate.core.residual.linearised_model import Hypothesis
from palpate.core.residual.plain_fit import PlainFit


def together(first: Effect, second: Effect) -> Effect:
    """Both effects as one; its variants are made by `joined`."""
    return Effect(
        first.id + JOINED + second.id,
        f"{first.words}, and {second.words}",
        (*first.parameters, *second.parameters),
        lambda around: [
            joined(a, b, len(first.parameters)) for a in first.variants(around) for b in second.variants(around)
        ],
        f"{first.settled_by}; and {second.settled_by}",
    )


def joined(first: Variant, second: Variant, split: int) -> Variant:
    """Both variants at once; the first takes the parameters before `split`."""

    def change(composition: Composition, phi: FloatArray) -> Composition:
        return second.applied(first.applied(composition, phi[:split]), phi[split:])

    name = " and ".join(v.name for v in (first, second) if v.name)
    return Variant(change, name, first.where or second.where)


def refit_pairs(
    fit: PlainFit,
    screened: Sequence[Screened],
    lead: Refit,
    factors: Mapping[str, float],
    rules: DecisionRules,
) -> list[Refit]:
    """Refits of the leading effect with another one beside it, best first.

    Every other effect is looked at, linear about the leading one's optimum and at the place where it fitted best alone. Those that are
    probable enough beside all other hypotheses, whose log Bayes factors are given, are refitted, with the leading effect's correction. A
    second effect that changes the stress-free mesh is capped (`variants.capped`): the correction is not of its mesh.
    """
    assert lead.hypothesis.effect is not None
    pairs = [_Pair.of(fit, lead, s) for s in screened if s.effect.id != lead.hypothesis.effect.id]
    seen = {pair.alone.effect.id: pair.alone.log_evidence for pair in pairs}
    probability = posterior({**factors, **seen}, len(screened), rules)
    worth = [pair for pair in pairs if probability[pair.alone.effect.id] > rules.pair_worth]
    worth = sorted(worth, key=lambda pair: -pair.alone.log_evidence)[: rules.at_most]
    out = []
    for pair in worth:
        found = refit_corrected(fit, pair.alone, pair.start, lead.correction)
        if found is not None:
            out.append(capped(replace(found, log_evidence=found.own_evidence - pair.alone.paid), pair.alone))
    return sorted(out, key=lambda f: -f.log_evidence)


@dataclass(frozen=True, eq=False)
class _Pair:
    """alone : the pair as one effect of one variant, looked at. start : place that its refit starts from."""

    alone: Screened
    start: Refit

    @classmethod
    def of(cls, fit: PlainFit, lead: Refit, second: Screened) -> _Pair:
        """The pair pays for the choice of both effects' variants: as much as each alone."""
        first = lead.hypothesis
        assert first.effect is not None and first.variant is not None
        effect, k = together(first.effect, second.effect), len(lead.phi)
        variant = joined(first.variant, second.variants[0], k)
        at = lead.linearisation.with_phi(np.concatenate([lead.phi, np.zeros(len(second.effect.parameters))]))
        S = fit.model.directions(Hypothesis(effect, variant), at)
        added = Directions(S, effect.scales, effect.bounds, at.phi)
        r, J = at.residual[:, None], at.in_theta
        free = np.concatenate([lead.beyond == 0.0, np.ones(len(at.phi), dtype=bool)])
        own = float(fit.noise.log_evidence(r, J, prior_precision(fit.bounds), [added], free)[0, 0]) - fit.log_evidence
        paid = lead.own_evidence - lead.log_evidence + second.scores[0].log_evidence - second.log_evidence
        whiten = fit.weighting.whiten
        taken = np.hstack([whiten(J), whiten(S[:, :k])])
        beside = score(whiten(at.residual), taken, whiten(S[:, k:]), second.effect.scales, second.effect.bounds)
        alone = Screened(effect, [variant], [beside], [S], own - paid, paid)
        return cls(
            alone,
            replace(lead, hypothesis=Hypothesis(effect, variant), linearisation=_begun(at, beside.estimate, effect, k)),
        )


def _begun(at: JointLinearisation, estimate: FloatArray, effect: Effect, k: int) -> JointLinearisation:
    """With half of what the second effect's parameters, from k on, are estimated to be; never exactly 0."""
    scales, (low, high) = effect.scales[k:], effect.bounds[k:].T
    guess = np.clip(0.5 * estimate, np.maximum(-scales, low), np.minimum(scales, high))
    guess = np.where(np.abs(guess) > 0.02 * scales, guess, np.clip(0.05 * scales, low, high))
    return at.with_phi(np.concatenate([at.phi[:k], guess]))
