"""One posterior over hypotheses: nothing, every effect of the library, two effects together, something without a name.

A hypothesis has a prior, which is shared out once over the whole library, and a Bayes factor against nothing: the mean over its variants
of the marginal likelihood, each averaged over the noise (`inference.evidence.log_evidence`). Probability is prior times factor.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import logsumexp, softmax

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules

NONE, UNKNOWN = "none", "unknown"
# Between the ids of two effects that act together.
JOINED = "+"


def log_prior(hypothesis: str, library: int, rules: DecisionRules) -> float:
    """Log prior probability of a hypothesis, by name; library : number of effects that the case may have.

    All hypotheses together sum to 1: nothing, something unnamed, each effect alone and each pair of effects, looked at or not.
    """
    if hypothesis == NONE:
        return float(np.log(rules.prior_nothing))
    gap = 1.0 - rules.prior_nothing
    if hypothesis == UNKNOWN:
        return float(np.log(gap * rules.prior_unknown))
    named, pairs = gap * (1.0 - rules.prior_unknown), library * (library - 1) // 2
    together = rules.prior_pair if pairs else 0.0
    share = together / pairs if JOINED in hypothesis else (1.0 - together) / library
    return float(np.log(named * share))


def posterior(factors: Mapping[str, float], library: int, rules: DecisionRules) -> dict[str, float]:
    """Probability of every hypothesis, NONE first. factors : log Bayes factors against nothing, of all others."""
    every = {NONE: 0.0, **factors}
    logs = [log_prior(name, library, rules) + factor for name, factor in every.items()]
    return dict(zip(every, softmax(logs).tolist(), strict=True))


def log_factor_of_a_gap(factors: Mapping[str, FloatArray], library: int, rules: DecisionRules) -> FloatArray:
    """Log Bayes factor (d,) of any cause against nothing, from those of the causes (d,)."""
    rows = [log_prior(name, library, rules) + factor for name, factor in factors.items()]
    return np.asarray(logsumexp(rows, axis=0) - np.log(1.0 - rules.prior_nothing))


def given_a_gap(probability: Mapping[str, float]) -> dict[str, float]:
    """Probabilities of the causes alone."""
    rest = {name: p for name, p in probability.items() if name != NONE}
    total = max(sum(rest.values()), 1e-300)
    return {name: p / total for name, p in rest.items()}


def smallest_set(probability: Mapping[str, float], share: float) -> tuple[str, ...]:
    """The fewest hypotheses, the most probable one first, that hold this share of the probability."""
    ranked = sorted(probability, key=lambda name: -probability[name])
    total = np.cumsum([probability[name] for name in ranked])
    return tuple(ranked[: int(np.searchsorted(total, share * total[-1] * (1.0 - 1e-12))) + 1])


def names_of(hypotheses: Sequence[str], most: int) -> tuple[str, ...]:
    """Ids of the effects in hypotheses, each once, in order, at most so many; what has no name is left out."""
    each = [name for one in hypotheses if one not in (NONE, UNKNOWN) for name in one.split(JOINED)]
    return tuple(dict.fromkeys(each))[:most]
