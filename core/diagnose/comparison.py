"""Every hypothesis of a case beside nothing: looked at linear about the plain fit, then at its own optimum where that is worth it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.gap_test import GapTest, NullDistribution, null_distribution
from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.posterior import NONE, UNKNOWN, posterior
from palpate.core.diagnose.refit.pairs import refit_pairs
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.refit.variants import refit_variants
from palpate.core.inference.evidence import Directions, mean_of_exponentials
from palpate.core.inference.posterior import prior_precision
from palpate.core.residual.plain_fit import PlainFit
from palpate.core.worker.progress import Progress, part, silent

# What makes refits (a list, best first) better before pairs are looked at, given the effects looked at and a progress.
Improve = Callable[[Sequence[Screened], list[Refit], Progress], list[Refit]]


@dataclass(frozen=True, eq=False)
class Comparison:
    """test : for a gap. screened : every effect looked at, the likeliest first. refits, pairs : best first. factors : log Bayes factor
    against nothing of every hypothesis by name. probability : of every hypothesis, nothing among them; sums to 1."""

    test: GapTest
    screened: Sequence[Screened]
    refits: Sequence[Refit]
    pairs: Sequence[Refit]
    factors: dict[str, float]
    probability: dict[str, float]

    @property
    def lead(self) -> Refit | None:
        """The most probable hypothesis of those refitted."""
        refits = {f.hypothesis.effect.id: f for f in (*self.refits, *self.pairs) if f.hypothesis.effect is not None}
        return refits[max(refits, key=lambda name: self.probability[name])] if refits else None


def compared(
    fit: PlainFit,
    screened: Sequence[Screened],
    unnamed: Sequence[Directions],
    rules: DecisionRules,
    seed: int = 1,
    progress: Progress = silent,
    improve: Improve = lambda _, refits, __: refits,
    acting: Collection[str] = (),
) -> Comparison:
    """The comparison of a plain fit with effects that were looked at (`score_test.screen`) and with what has no name.

    unnamed : variants of a cause without a name. improve : see `Improve`. acting : effects that are known to act, which are refitted
    though there be no gap.
    """
    progress(0.0, "every effect, averaged over the noise")
    weighed, null = _looked_at(fit, screened, unnamed, rules, seed)
    test, pairs = null.test(), list[Refit]()
    looked_for = weighed if test.p_value <= rules.clear else [s for s in weighed if s.effect.id in acting]
    refits = _refits(fit, looked_for, rules, part(progress, 0.3, 0.65))
    if test.p_value <= rules.clear:
        test = null.test({name: value for name, value in _factors(null, refits).items() if name != UNKNOWN})
    if test.detected and refits:
        refits = improve(weighed, refits, part(progress, 0.65, 0.9))
        progress(0.9, "two effects together")
        pairs = refit_pairs(fit, weighed, refits[0], _factors(null, refits), rules)
    factors = _factors(null, [*refits, *pairs])
    probability = posterior(factors, len(weighed), rules)
    # Draws are not refitted, so that what the data alone gain by a first look may be gone where each cause is at its own optimum.
    test = replace(test, detected=test.detected and probability[NONE] < 1.0 - probability[NONE])
    return Comparison(test, weighed, refits, pairs, factors, probability)


def _factors(null: NullDistribution, refits: Sequence[Refit]) -> dict[str, float]:
    """Log Bayes factors against nothing of every hypothesis by name: at its own optimum where it was refitted, else linear about
    the plain fit."""
    linear = {name: mean_of_exponentials(null.of_data(name)) for name in null.factors}
    return linear | {f.hypothesis.effect.id: f.log_evidence for f in refits if f.hypothesis.effect is not None}


def _looked_at(
    fit: PlainFit, screened: Sequence[Screened], unnamed: Sequence[Directions], rules: DecisionRules, seed: int
) -> tuple[list[Screened], NullDistribution]:
    """Every effect, the likeliest first, weighed over the noise, and the same of draws of noise."""
    causes = {s.effect.id: s.linear for s in screened} | {UNKNOWN: unnamed}
    r, J = fit.linearisation.residual, fit.linearisation.in_theta
    null = null_distribution(fit.noise, r, J, prior_precision(fit.bounds), causes, seed, rules=rules)
    weighed = [s.weighed(null.of_data(s.effect.id)) for s in screened]
    return sorted(weighed, key=lambda s: -s.log_evidence), null


def _refits(fit: PlainFit, screened: Sequence[Screened], rules: DecisionRules, progress: Progress) -> list[Refit]:
    """Effects refitted in full, best first."""
    least = screened[0].log_evidence - rules.hopeless if screened else 0.0
    worth = [s for s in screened if s.log_evidence > least or s.tried == 1]
    out = []
    for k, s in enumerate(worth):
        progress(k / len(worth), f"refit with {s.effect.id}")
        refitted = refit_variants(fit, s, rules)
        if refitted is not None:
            out.append(refitted)
    return sorted(out, key=lambda f: -f.log_evidence)
