"""Judgement of a body: test for a gap, verdict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy import stats

from palpate.core.diagnose.bench_bodies.fit import BodyFit
from palpate.core.diagnose.bench_bodies.rivals import Rival, squares
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.verdict.rules import Rule, always, first_that_holds
from palpate.core.diagnose.verdict.verdict import (
    AMBIGUOUS,
    NONE,
    UNKNOWN,
    Verdict,
    probabilities,
)
from palpate.core.inference.evidence import score

GRAVITY = "gravity_change"


def p_value(base: BodyFit) -> float:
    """p-value of the residual of markers and reactions under their noise alone (chi-squared)."""
    fit = base.plain
    free = max(fit.model.n - len(fit.linearisation.theta), 1)
    return float(stats.chi2.sf(squares(fit, fit.linearisation), free))


def unnamed(base: BodyFit) -> float:
    """Log evidence of a displacement of every state's markers that no effect of the library makes."""
    fit, columns = base.plain, []
    for data, rows in zip(base.data, fit.model.rows, strict=True):
        S = np.zeros((fit.model.n, 3))
        S[rows.start : rows.start + data.n_seen] = np.tile(np.eye(3), (len(data.seen), 1))[data.seen.ravel()]
        columns.append(S[:, S.any(axis=0)])
    S = np.hstack(columns)
    r, J = fit.residual, fit.jacobian
    return score(
        r, J, fit.weighting.whiten(S), np.full(S.shape[1], base.options.decision_rules.bench_unnamed_mm)
    ).log_evidence


@dataclass(frozen=True, eq=False)
class BodyFindings:
    """Findings on which `BODY_RULES` decide.

    detected : whether there is a gap. rivals : effects refitted, best first. unnamed : log evidence, see `unnamed`.
    gravity_unmodelled : whether gravity is known to act and the plain model has none. rules : thresholds.
    """

    detected: bool
    rivals: Sequence[Rival]
    unnamed: float
    gravity_unmodelled: bool
    rules: DecisionRules = field(kw_only=True)

    @cached_property
    def probability(self) -> dict[str, float]:
        """Probability of every effect and of "unknown", given that there is a gap."""
        evidence = {r.effect.id: r.log_evidence for r in self.rivals}
        return probabilities(evidence, self.unnamed, self.rules.prior_unknown)

    @property
    def top(self) -> float:
        """Probability of the most probable effect; 0 where there is none."""
        return max((self.probability[r.effect.id] for r in self.rivals), default=0.0)

    @cached_property
    def tied(self) -> list[Rival]:
        """Effects that cannot be told from the most probable one, itself among them."""
        return [r for r in self.rivals if self.probability[r.effect.id] * self.rules.tied >= self.top]

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the tied effects, at most as many as are named."""
        return tuple(r.effect.id for r in self.tied[: self.rules.most_candidates])

    @property
    def gravity_absorbed(self) -> bool:
        """Whether gravity is left out and the states, though they show no gap, do not speak against it."""
        gravity = next((r for r in self.rivals if r.effect.id == GRAVITY), None)
        return self.gravity_unmodelled and gravity is not None and gravity.log_evidence > -np.log(self.rules.tied)


BODY_RULES: tuple[Rule[BodyFindings], ...] = (
    Rule(
        "gravity_absorbed",
        lambda f: not f.detected and f.gravity_absorbed,
        AMBIGUOUS,
        "gravity is known to act and is not in the model, but the stiffness takes its place in these states",
        lambda f: (GRAVITY,),
    ),
    Rule(
        "no_gap",
        lambda f: not f.detected,
        NONE,
        "what the plain model leaves is no more than the markers' own error",
    ),
    Rule(
        "nothing_named",
        lambda f: not f.tied or f.probability[UNKNOWN] > f.rules.tied * f.top,
        UNKNOWN,
        "no effect of the library explains the gap as well as something unnamed",
    ),
    Rule(
        "several_effects",
        lambda f: len(f.tied) > 1 or f.probability[UNKNOWN] * f.rules.tied > f.top,
        AMBIGUOUS,
        "these effects explain the gap about equally well",
        lambda f: f.names,
    ),
    Rule(
        "not_predicted",
        lambda f: not f.tied[0].predicts,
        AMBIGUOUS,
        "the effect fits best, but not every state is predicted better from the others",
        lambda f: f.names,
    ),
    Rule(
        "explained",
        always,
        lambda f: f.names[0],
        "the effect explains the gap and predicts the states left out",
        lambda f: f.names,
    ),
)


def decide_body(base: BodyFit, rivals: Sequence[Rival], detected: bool) -> Verdict:
    """Verdict by the first of `BODY_RULES` that holds.

    rivals : effects refitted, best first. detected : whether there is a gap.
    """
    problem = base.problem
    known = not problem.model_gravity and any(np.linalg.norm(s.gravity) > 0.1 for s in problem.states)
    findings = BodyFindings(detected, rivals, unnamed(base), known, rules=base.options.decision_rules)
    decision = first_that_holds(BODY_RULES, findings)
    return Verdict(decision.verdict, decision.candidates, findings.probability, decision.sentence, decision.rule)
