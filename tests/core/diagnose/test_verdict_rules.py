"""Every reason for a verdict, by a case that it decides and one, changed in a single fact, that it does not."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import pytest

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.verdict.decide import REASONS, decide
from palpate.core.diagnose.verdict.verdict import ModelCheck, Verdict

NUMBERS = DecisionRules()
LEFT, AHEAD = ModelCheck("something_left", 0.001, "more than noise"), ModelCheck("not_predicted", 0.02, "missed")


@dataclass(frozen=True)
class Found:
    """What a verdict hangs on: probabilities of the causes, of which nothing has what is left of 1."""

    causes: dict[str, float] = field(default_factory=lambda: {"prestress": 0.95, "inclusion": 0.02, "unknown": 0.02})
    detected: bool = True
    checks: tuple[ModelCheck, ...] = (AHEAD,)
    told: bool = True
    lacking: tuple[str, ...] = ()
    rules: DecisionRules = NUMBERS

    @property
    def verdict(self) -> Verdict:
        posterior = {"none": 1.0 - sum(self.causes.values()), **self.causes}
        return decide(posterior, self.detected, self.checks, told=self.told, lacking=self.lacking, rules=self.rules)


CLEAR = Found()


def among(**causes: float) -> Found:
    return replace(CLEAR, causes=causes)


PAIR = replace(CLEAR, causes={"prestress+volume_change": 0.8, "prestress": 0.1, "unknown": 0.05})
# Reason -> what it decides, verdict, candidates, and the same with one fact changed that it does not decide.
CASES: dict[str, tuple[Found, str, tuple[str, ...], Found]] = {
    "nothing_told": (replace(CLEAR, detected=False, told=False), "ambiguous", (), replace(CLEAR, detected=False)),
    "known_to_act": (
        replace(CLEAR, detected=False, lacking=("gravity_change",)),
        "ambiguous",
        ("gravity_change",),
        replace(CLEAR, detected=False),
    ),
    "no_gap": (replace(CLEAR, detected=False), "none", (), CLEAR),
    "nothing_named": (
        among(prestress=0.45, unknown=0.5),
        "unknown",
        (),
        among(prestress=0.5, unknown=0.45),
    ),
    "two_effects": (
        PAIR,
        "ambiguous",
        ("prestress", "volume_change"),
        replace(CLEAR, causes={"prestress": 0.95, "prestress+volume_change": 0.02}),
    ),
    "several_effects": (
        among(prestress=0.6, inclusion=0.35, unknown=0.01),
        "ambiguous",
        ("prestress", "inclusion"),
        among(prestress=0.9, inclusion=0.05, unknown=0.01),
    ),
    "unnamed_as_likely": (
        among(prestress=0.6, unknown=0.35, inclusion=0.01),
        "ambiguous",
        ("prestress",),
        among(prestress=0.9, unknown=0.05, inclusion=0.01),
    ),
    "something_left": (replace(CLEAR, checks=(AHEAD, LEFT)), "ambiguous", ("prestress",), CLEAR),
    "explained": (CLEAR, "prestress", ("prestress",), replace(CLEAR, detected=False)),
}


@pytest.mark.parametrize("name", CASES)
def test_a_reason_decides(name: str) -> None:
    found, verdict, candidates, otherwise = CASES[name]
    assert (found.verdict.decided_by, found.verdict.verdict, found.verdict.candidates) == (name, verdict, candidates)
    assert found.verdict.why == {**REASONS, "something_left": "more than noise"}[name]
    assert otherwise.verdict.decided_by != name


def test_every_reason_has_a_case() -> None:
    assert set(REASONS) | {"something_left"} == set(CASES)


def test_probabilities_of_causes_are_given_a_gap_and_those_of_all_are_kept() -> None:
    found = among(prestress=0.4, unknown=0.1).verdict
    assert found.probability == pytest.approx({"prestress": 0.8, "unknown": 0.2})
    assert found.posterior == pytest.approx({"none": 0.5, "prestress": 0.4, "unknown": 0.1})


def test_a_name_in_several_hypotheses_is_named_once_and_three_at_most() -> None:
    causes = {"a": 0.3, "a+b": 0.3, "c": 0.2, "d": 0.1, "e": 0.1}
    assert replace(CLEAR, causes=causes).verdict.candidates == ("a", "b", "c")
    two = replace(NUMBERS, most_candidates=2)
    assert replace(CLEAR, causes=causes, rules=two).verdict.candidates == ("a", "b")


@pytest.mark.parametrize(
    ("changes", "found", "usual", "other"),
    [
        ({"sure": 0.99}, CLEAR, "explained", "several_effects"),
        ({"sure": 0.5}, CASES["several_effects"][0], "several_effects", "explained"),
        ({"check_level": 0.05}, CLEAR, "explained", "not_predicted"),
        ({"check_level": 1e-4}, CASES["something_left"][0], "something_left", "explained"),
    ],
)
def test_other_numbers_decide_otherwise(changes: dict[str, float], found: Found, usual: str, other: str) -> None:
    assert found.verdict.decided_by == usual
    assert replace(found, rules=replace(NUMBERS, **changes)).verdict.decided_by == other  # type: ignore[arg-type]
