"""Verdicts, and what each effect is judged by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.inference.heldout import Gain

NONE, AMBIGUOUS, UNKNOWN = "none", "ambiguous", "unknown"


@dataclass(frozen=True)
class Judged:
    """One effect after its refit.

    log_evidence : against the plain model. gain : on data left out. placebo_p : share of
    placebo effects that gain as much. share_of_ceiling : of what a saturated field gains on data left out. remainder_p
    : of the residual it leaves, under the noise. cosine : between what the best effect does to the data, the stiffness
    projected out, and the nearest thing this one could do. unlike : why what fits is not what the effect's name means,
    "" where it is.
    """

    effect: str
    log_evidence: float
    gain: Gain
    placebo_p: float
    share_of_ceiling: float
    remainder_p: float
    cosine: float = 0.0
    unlike: str = ""

    def needed_odds(self, rules: DecisionRules) -> float:
        """How many times likelier the best effect must be to be told from this one."""
        return rules.tied_twins if self.cosine > rules.twins else rules.tied

    def predicts(self, rules: DecisionRules) -> bool:
        """Whether it predicts what it has not seen, and better than placebo effects of its size: one level decides."""
        return self.gain.mean_mm2 > 0.0 and self.placebo_p <= rules.placebo_level

    def something_left(self, rules: DecisionRules) -> bool:
        """Whether something like it may be the cause instead: it leaves more than noise, and a free field predicts
        better.

        A free field that predicts no better: what remains is nothing that any missing force would foretell, but walls
        and mesh, which under good contours stand out of the noise where much moves.
        """
        return self.remainder_p < rules.left_over and self.share_of_ceiling < rules.nearly_all


@dataclass(frozen=True)
class Verdict:
    """verdict and candidates as in diagnosis.json; probability of each effect and of "unknown"; why, in words.

    decided_by : name of the rule that decided, a row of `decide.RULES`.
    """

    verdict: str
    candidates: tuple[str, ...]
    probability: Mapping[str, float]
    why: str
    decided_by: str


def probabilities(evidence: Mapping[str, float], unknown: float, prior_unknown: float) -> dict[str, float]:
    """Of every effect and of "unknown", given that there is a gap and the effects were equally likely before.

    prior_unknown : probability, before, that none of them is the cause.
    """
    names = [*evidence, UNKNOWN]
    n = max(len(evidence), 1)
    log = np.array(
        [*(np.log((1.0 - prior_unknown) / n) + v for v in evidence.values()), np.log(prior_unknown) + unknown]
    )
    weight = np.exp(log - log.max())
    return dict(zip(names, (weight / weight.sum()).tolist(), strict=True))
