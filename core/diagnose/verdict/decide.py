"""The verdict on a case: the smallest set of hypotheses that holds a stated share of the posterior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.posterior import JOINED, NONE, UNKNOWN, given_a_gap, names_of, smallest_set
from palpate.core.diagnose.verdict.verdict import AMBIGUOUS, ModelCheck, Verdict

# Reasons that decide, beside the names of model checks, and their sentences.
TWO_EFFECTS = "two_effects"
REASONS = {
    "nothing_told": "the stiffness may be anything that was allowed, so that it takes the place of whatever the model leaves out",
    "no_gap": "what the plain model leaves is no more than contours, walls and mesh explain",
    "known_to_act": "what is known to act is not in the model, but the stiffness takes its place in these states",
    "nothing_named": "no effect of the library explains the gap as well as a free smooth field of forces",
    TWO_EFFECTS: "no effect alone explains the gap, these two together do",
    "several_effects": "these effects explain the gap about equally well",
    "unnamed_as_likely": "the effect explains the gap no better than something unnamed might",
    "explained": "the effect explains the gap",
}


def decide(
    posterior: Mapping[str, float],
    detected: bool,
    checks: Sequence[ModelCheck] = (),
    *,
    told: bool = True,
    lacking: tuple[str, ...] = (),
    rules: DecisionRules,
) -> Verdict:
    """The verdict.

    posterior : probability of every hypothesis (`posterior.posterior`). detected : outcome of the gap test. checks : of the most probable
    hypothesis; one that fails vetoes a single name. told : whether the scans tell any region's stiffness. lacking : effects that are
    known to act though the model has none of them, where the data do not speak against them.
    """
    probability = given_a_gap(posterior)

    def answer(verdict: str, names: tuple[str, ...], reason: str, sentence: str = "") -> Verdict:
        return Verdict(verdict, names, probability, sentence or REASONS[reason], reason, posterior)

    if not detected and lacking:
        return answer(AMBIGUOUS, lacking, "known_to_act")
    if not detected:
        return answer(NONE, (), "no_gap") if told else answer(AMBIGUOUS, (), "nothing_told")
    likely = smallest_set(probability, rules.sure)
    names = names_of(likely, rules.most_candidates)
    if likely[0] == UNKNOWN:
        return answer(UNKNOWN, (), "nothing_named")
    if JOINED in likely[0]:
        return answer(AMBIGUOUS, names, TWO_EFFECTS)
    if len(names) > 1:
        return answer(AMBIGUOUS, names, "several_effects")
    if UNKNOWN in likely:
        return answer(AMBIGUOUS, names, "unnamed_as_likely")
    failed = [check for check in checks if check.p_value < rules.check_level]
    if failed:
        return answer(AMBIGUOUS, names, failed[0].name, failed[0].sentence)
    return answer(names[0], names, "explained")
