"""The verdict on a case: rules over evidence and predictions, tried in order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.verdict.rules import Rule, always, first_that_holds
from palpate.core.diagnose.verdict.verdict import (
    AMBIGUOUS,
    NONE,
    UNKNOWN,
    Judged,
    Verdict,
    probabilities,
)

# Name of the rule by which two effects together are the answer.
TWO_EFFECTS = "two_effects"


@dataclass(frozen=True, eq=False)
class Findings:
    """What the rules of a verdict look at.

    detected : outcome of the gap test. judged : effects after their refits. unknown : log evidence of a free smooth
    field of forces. pair : two effects together, and the log evidence of both; None where no pair predicts more than
    the better one alone. told : whether the scans tell any region's stiffness. first_look : log evidence of the effects that
    were not refitted; they share the prior. rules : the numbers that the conditions hang on.
    """

    detected: bool
    judged: Sequence[Judged]
    unknown: float
    pair: tuple[tuple[str, ...], float] | None = None
    told: bool = True
    first_look: Mapping[str, float] = field(default_factory=dict)
    rules: DecisionRules = field(kw_only=True)

    @cached_property
    def probability(self) -> dict[str, float]:
        """Of every effect and of "unknown", given that there is a gap."""
        evidence = {**self.first_look, **{j.effect: j.log_evidence for j in self.judged}}
        return probabilities(evidence, self.unknown, self.rules.prior_unknown)

    @cached_property
    def ranked(self) -> list[Judged]:
        """Effects, the most probable one first."""
        return sorted(self.judged, key=lambda j: -self.probability[j.effect])

    @property
    def top(self) -> float:
        """Probability of the most probable effect; 0 where there is none."""
        return max((self.probability[j.effect] for j in self.ranked), default=0.0)

    @property
    def p_unknown(self) -> float:
        """Probability that no effect of the library is the cause."""
        return self.probability[UNKNOWN]

    @cached_property
    def tied(self) -> list[Judged]:
        """The most probable effect and all that cannot be told from it; empty where its probability is 0.

        Whatever is more probable than one of these is among them: a twin is allowed longer odds than what lies between.
        """
        if self.top <= 0.0:
            return []
        near = [self.probability[j.effect] * j.needed_odds(self.rules) >= self.top for j in self.ranked]
        return self.ranked[: int(np.flatnonzero(near)[-1]) + 1]

    @property
    def best(self) -> Judged:
        """The most probable effect. Precondition: `tied` is not empty."""
        return self.tied[0]

    @property
    def names(self) -> tuple[str, ...]:
        """Ids of the tied effects, at most as many as are named."""
        return tuple(j.effect for j in self.tied[: self.rules.most_candidates])

    @property
    def pair_names(self) -> tuple[str, ...]:
        """Ids of the pair's effects; empty where there is no pair."""
        return () if self.pair is None else self.pair[0]

    @property
    def fewest_sure(self) -> tuple[str, ...]:
        """The fewest effects, the most probable first, that are sure together; at most as many as are named."""
        total = np.cumsum([self.probability[j.effect] for j in self.ranked])
        count = int(np.searchsorted(total, self.rules.sure)) + 1
        return tuple(j.effect for j in self.ranked[: min(count, self.rules.most_candidates)])

    @property
    def pair_explains_more(self) -> bool:
        """Whether two effects together are far likelier than any one alone, and than something unnamed."""
        alone = max((j.log_evidence for j in self.judged), default=-np.inf)
        return self.pair is not None and self.pair[1] > max(alone, self.unknown) + np.log(self.rules.tied_twins)

    @property
    def unnamed_wins(self) -> bool:
        """Whether something unnamed is so much more probable than every effect that none need be named (strong evidence)."""
        return not self.tied or self.p_unknown > self.rules.tied_twins * self.top

    @property
    def foretells_nearly_all(self) -> bool:
        """Whether the best effect predicts what was left out nearly as well as a free field, and better than placebos do."""
        return (
            bool(self.tied) and self.best.predicts(self.rules) and self.best.share_of_ceiling >= self.rules.nearly_all
        )

    @property
    def unnamed_ties(self) -> bool:
        """Whether something unnamed cannot be told from the best effect."""
        return self.p_unknown * self.rules.tied > self.top

    @property
    def little_closed(self) -> bool:
        """Whether the best effect closes less than half of what a free field closes on data left out."""
        return self.best.share_of_ceiling < self.rules.half

    @property
    def much_left(self) -> bool:
        """Whether the best effect leaves what is certainly no noise."""
        return self.best.remainder_p < self.rules.remainder_level


RULES: tuple[Rule[Findings], ...] = (
    Rule(
        "nothing_told",
        lambda f: not f.detected and not f.told,
        AMBIGUOUS,
        "the stiffness may be anything that was allowed, so that it takes the place of whatever the model leaves out",
    ),
    Rule(
        "no_gap",
        lambda f: not f.detected,
        NONE,
        "what the plain model leaves is no more than contours, walls and mesh explain",
    ),
    Rule(
        TWO_EFFECTS,
        lambda f: f.pair_explains_more,
        AMBIGUOUS,
        "no effect alone explains the gap, these two together do",
        lambda f: f.pair_names,
    ),
    Rule(
        "unnamed_fits_better",
        lambda f: f.unnamed_wins and f.foretells_nearly_all,
        AMBIGUOUS,
        "the effect predicts what was left out nearly as well as a free field of forces, which fits the whole still better: "
        "it may stand for something like it",
        lambda f: f.names,
    ),
    Rule(
        "nothing_named",
        lambda f: f.unnamed_wins,
        UNKNOWN,
        "no effect of the library explains the gap as well as a free smooth field of forces",
    ),
    Rule(
        "too_little_closed",
        lambda f: f.much_left and f.little_closed,
        UNKNOWN,
        "the best named effect leaves more than noise, and closes less than half of what can be closed",
    ),
    Rule(
        "several_effects",
        lambda f: len(f.tied) > 1,
        AMBIGUOUS,
        "these effects explain the gap about equally well",
        lambda f: f.names,
    ),
    Rule(
        "unnamed_as_likely",
        lambda f: f.unnamed_ties,
        AMBIGUOUS,
        "the effect explains the gap no better than something unnamed might",
        lambda f: f.names,
    ),
    Rule(
        "not_predicted",
        lambda f: not f.best.predicts(f.rules),
        AMBIGUOUS,
        "the effect fits best, but does not predict what was left out better than other effects of its size would",
        lambda f: f.names,
    ),
    Rule(
        "not_sure",
        lambda f: f.top < f.rules.sure,
        AMBIGUOUS,
        "the effect explains the gap best, but less than four times as probably as all others together",
        lambda f: f.fewest_sure,
    ),
    Rule(
        "smaller_part",
        lambda f: f.little_closed,
        AMBIGUOUS,
        "the effect fits best, but closes less than half of what can be closed: something else may be the larger part",
        lambda f: f.names,
    ),
    Rule(
        "unlike_its_name",
        lambda f: f.best.unlike != "",
        AMBIGUOUS,
        "what fits best is not what the effect's name means",
        lambda f: f.names,
        lambda f: f.best.unlike,
    ),
    Rule(
        "something_left",
        lambda f: f.best.something_left(f.rules),
        AMBIGUOUS,
        "the effect explains the gap best, but what it leaves is still more than noise: it may stand for something "
        "like it",
        lambda f: f.names,
    ),
    Rule(
        "explained",
        always,
        lambda f: f.best.effect,
        "the effect explains the gap and predicts what was left out",
        lambda f: f.names,
    ),
)


def decide(
    detected: bool,
    judged: Sequence[Judged],
    unknown: float,
    pair: tuple[tuple[str, ...], float] | None = None,
    *,
    told: bool = True,
    first_look: Mapping[str, float] | None = None,
    rules: DecisionRules,
) -> Verdict:
    """The first of `RULES` that holds decides. Arguments as in `Findings`."""
    findings = Findings(detected, judged, unknown, pair, told, first_look or {}, rules=rules)
    decision = first_that_holds(RULES, findings)
    return Verdict(decision.verdict, decision.candidates, findings.probability, decision.sentence, decision.rule)
