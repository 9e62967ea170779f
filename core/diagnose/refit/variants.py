"""Refits of the variants of one effect, and their joint evidence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.refit.refit import Refit, refit
from palpate.core.inference.evidence import mean_of_exponentials
from palpate.core.residual.plain_fit import PlainFit


def refit_variants(fit: PlainFit, screened: Screened, rules: DecisionRules) -> Refit | None:
    """Refit of an effect's best variants, joined by `of_all`; None when the model cannot be solved with any."""
    first = [s.log_evidence for s in screened.scores[: rules.at_most]]
    attempts = [
        refit(fit, screened, k) for k, evidence in enumerate(first) if evidence > first[0] - rules.variants_within
    ]
    solved = [f for f in attempts if f is not None]
    return capped(of_all(solved, screened), screened) if solved else None


def of_all(refits: Sequence[Refit], screened: Screened) -> Refit:
    """Likeliest of the refitted variants, the rest as its others; log_evidence : the mean over all variants.

    A refitted variant counts with the evidence at its own optimum, one that was not refitted with the same, linear about the plain fit.
    """
    best = max(refits, key=lambda f: f.own_evidence)
    each = np.array([s.log_evidence for s in screened.scores])
    each[[_which(f, screened) for f in refits]] = [f.own_evidence for f in refits]
    evidence = mean_of_exponentials(each) - screened.paid
    return replace(best, log_evidence=evidence, others=tuple(f for f in refits if f is not best))


def capped(refitted: Refit, screened: Screened) -> Refit:
    """Refit whose log evidence is capped at that of the score test, where the effect changes the stress-free mesh.

    A changed mesh has another error of the quick element; the correction belongs to the plain model's mesh. On
    effect-free cases such refits gained up to 5 in log evidence over the score test, which uses the plain model's mesh.
    """
    if refitted.linearisation.first.scene.composition.geometry is None:
        return refitted
    return replace(refitted, log_evidence=min(refitted.log_evidence, screened.log_evidence))


def corrected(again: Refit, refitted: Refit, screened: Screened) -> Refit:
    """Refit of all variants after its best one was refitted `again` with the better element's correction.

    The other variants are taken to gain as much as the best one, each by itself too: a twin, such as softer tissue on one side
    and stiffer on the other, must not lose its weight in the stiffness because the correction was made for one of the two. The
    evidence is not capped: the correction was made on the variant's own stress-free mesh.
    """
    gained = again.own_evidence - refitted.own_evidence
    evidence = of_all([refitted, *refitted.others], screened).log_evidence + gained
    others = tuple(replace(f, own_evidence=f.own_evidence + gained) for f in refitted.others)
    return replace(again, log_evidence=evidence, others=others)


def _which(refitted: Refit, screened: Screened) -> int:
    assert refitted.hypothesis.variant is not None
    return screened.variants.index(refitted.hypothesis.variant)
