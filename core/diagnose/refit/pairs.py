"""Pairs of effects, for cases where one effect alone leaves more than noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.effects import Effect, Variant
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.refit.variants import refit_variants
from palpate.core.forward.composition import Composition
from palpate.core.inference.evidence import score
from palpate.core.residual.plain_fit import PlainFit

JOINED = "+"


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
    fit: PlainFit, screened: Sequence[Screened], refits: Sequence[Refit], rules: DecisionRules
) -> list[Refit]:
    """Refits of the best effect with each of its likeliest partners, best first.

    Every effect stays at the place where it fitted best alone. log_evidence : less the cost of the choice of partner.
    """
    by_id = {s.effect.id: s for s in screened}
    ids = [f.hypothesis.effect.id for f in refits if f.hypothesis.effect is not None]
    pairs = [_screened(fit, by_id[ids[0]], by_id[name], rules.partners) for name in ids[1:]]
    pairs = sorted(pairs, key=lambda s: -s.log_evidence)[: rules.partners]
    refits_of_pairs = [f for f in (refit_variants(fit, pair, rules) for pair in pairs) if f is not None]
    return sorted(refits_of_pairs, key=lambda f: -f.log_evidence)


def _screened(fit: PlainFit, first: Screened, second: Screened, partners: int) -> Screened:
    """Score test of a pair.

    Its log evidence is less the cost of both effects' variants and of the choice among `partners`.
    """
    effect = together(first.effect, second.effect)
    S = np.hstack([first.directions[0], second.directions[0]])
    r, J = fit.weighting.whiten(fit.linearisation.residual), fit.weighting.whiten(fit.linearisation.in_theta)
    pair_score = score(r, J, fit.weighting.whiten(S), effect.scales, effect.bounds)
    variant = joined(first.variants[0], second.variants[0], len(first.effect.parameters))
    paid = sum(s.log_evidence - s.scores[0].log_evidence for s in (first, second)) - float(np.log(partners))
    return Screened(effect, [variant], [pair_score], [S], pair_score.log_evidence + paid)
