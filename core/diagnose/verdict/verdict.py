"""Verdicts, the thresholds they hang on, and what each effect is judged by."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.diagnose.detection.gap_test import PRIOR_UNKNOWN
from palpate.core.inference.heldout import Gain

NONE, AMBIGUOUS, UNKNOWN = "none", "ambiguous", "unknown"

# Effects whose probability is within this factor of the best one's cannot be told from it: less is "positive evidence" at best
# (Kass & Raftery 1995). Twins, which could imitate all but a tenth of what the best does to the data, need more: there the odds
# hang on the small errors of model and noise.
TIED, TIED_TWINS, TWINS = 5.0, 20.0, 0.95
# A verdict of one name must be this probable; else the fewest effects that are so together are named.
SURE = 0.8
# At most so many are named: more would say nothing.
MOST_CANDIDATES = 3
# A remainder this improbable under the noise is no noise. A verdict of one name needs more: what it leaves must not raise the alarm of the
# gap test itself, or it must predict what was left out so nearly as well as a free field does, over what that gains: then what remains is
# nothing that any missing force would foretell, but walls and mesh, which under good contours stand out of the noise where much moves.
REMAINDER_LEVEL, LEFT_OVER, NEARLY_ALL = 0.01, 0.05, 0.9
# Less than this of what a free field gains on data left out, and the name explains the smaller part of what can be foretold.
HALF = 0.5


@dataclass(frozen=True)
class Judged:
    """One effect after its refit.

    log_evidence : against the plain model, tempered (`judge.tempered`). gain : on data left out. placebo_p : share of placebo effects that
    gain as much.
    share_of_ceiling : of what a saturated field gains on data left out. remainder_p : of the residual it leaves, under the noise.
    cosine : between what the best effect does to the data, the stiffness projected out, and the nearest thing this one could do.
    unlike : why what fits is not what the effect's name means, "" where it is.
    """

    effect: str
    log_evidence: float
    gain: Gain
    placebo_p: float
    share_of_ceiling: float
    remainder_p: float
    cosine: float = 0.0
    unlike: str = ""

    @property
    def needed_odds(self) -> float:
        """How many times likelier the best effect must be to be told from this one."""
        return TIED_TWINS if self.cosine > TWINS else TIED

    @property
    def confirmed(self) -> bool:
        """Whether it predicts what it has not seen, better than placebo effects of its size."""
        return self.gain.accepted and self.placebo_p <= 0.05

    @property
    def something_left(self) -> bool:
        """Whether something like it may be the cause instead: it leaves more than noise, and a free field predicts better."""
        return self.remainder_p < LEFT_OVER and self.share_of_ceiling < NEARLY_ALL


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


def probabilities(evidence: Mapping[str, float], unknown: float) -> dict[str, float]:
    """Of every effect and of "unknown", given that there is a gap and the effects were equally likely before."""
    names = [*evidence, UNKNOWN]
    n = max(len(evidence), 1)
    log = np.array(
        [*(np.log((1.0 - PRIOR_UNKNOWN) / n) + v for v in evidence.values()), np.log(PRIOR_UNKNOWN) + unknown]
    )
    weight = np.exp(log - log.max())
    return dict(zip(names, (weight / weight.sum()).tolist(), strict=True))
