"""Refits of the variants of one effect, and their joint evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import logsumexp

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.refit.refit import Refit, refit
from palpate.core.residual.plain_fit import PlainFit


def refit_variants(fit: PlainFit, screened: Screened, rules: DecisionRules) -> Refit | None:
    """The best variants of an effect refitted, as `of_all` of them; None when the model cannot be solved with any."""
    first = [s.log_evidence for s in screened.scores[: rules.variants]]
    found = [refit(fit, screened, k) for k, evidence in enumerate(first) if evidence > first[0] - rules.variants_within]
    solved = [f for f in found if f is not None]
    return capped(of_all(solved, screened), screened) if solved else None


def of_all(found: Sequence[Refit], screened: Screened) -> Refit:
    """The likeliest of the refitted variants, the rest as its others; log_evidence : the mean over all variants,
    refitted or not.

    A refitted variant counts with its own evidence, the others with their first look's and the least that a refit
    gained. As if all had gained what the best one did, a load that may move and widen had evidence of 5 on effect-free
    cases, where its first look had none.
    """
    best = max(found, key=lambda f: f.own_evidence)
    first = np.array([s.log_evidence for s in screened.scores])
    at = [_which(f, screened) for f in found]
    own = np.array([f.own_evidence for f in found])
    now = first + (own - first[at]).min()
    now[at] = own
    evidence = screened.log_evidence + float(logsumexp(now) - logsumexp(first))
    return replace(best, log_evidence=evidence, others=tuple(f for f in found if f is not best))


def capped(found: Refit, screened: Screened) -> Refit:
    """With no more evidence than the first look has, where the stress-free mesh is another.

    Another mesh has another error of the quick element, which the correction, made for the plain model, does not
    follow: on effect-free cases such refits gained up to 5 over the first look, which has the plain model's mesh.
    """
    if found.linearisation.first.scene.composition.geometry is None:
        return found
    return replace(found, log_evidence=min(found.log_evidence, screened.log_evidence))


def corrected(again: Refit, found: Refit, screened: Screened) -> Refit:
    """`found` of all variants, with its best one refitted `again`: the others gain as much.

    Not capped: the correction is of its own stress-free mesh.
    """
    gained = again.own_evidence - found.own_evidence
    evidence = of_all([found, *found.others], screened).log_evidence + gained
    return replace(again, log_evidence=evidence, others=found.others)


def _which(found: Refit, screened: Screened) -> int:
    assert found.hypothesis.variant is not None
    return screened.variants.index(found.hypothesis.variant)
