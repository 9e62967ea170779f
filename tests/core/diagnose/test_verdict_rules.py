"""Every row of the tables of rules, by a case that it decides and one, changed in a single fact, that it does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import pytest

from palpate.core.diagnose.bench_bodies.judge import BODY_RULES, BodyFindings
from palpate.core.diagnose.bench_bodies.rivals import Rival
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.verdict.decide import RULES, Findings, decide
from palpate.core.diagnose.verdict.rules import first_that_holds
from palpate.core.diagnose.verdict.verdict import Judged
from palpate.core.inference.heldout import Gain

GOOD = Gain(1.0, 0.5, 0.75, 0.2, 0.75)
SMALL_GAIN, LOSS = Gain(1.0, 0.98, 0.04, 0.05, 0.04), Gain(1.0, 1.02, -0.04, 0.05, -0.04)
NUMBERS = DecisionRules()
PAIR = ("prestress", "volume_change")


def judged(effect: str = "prestress", evidence: float = 20.0, **changes: object) -> Judged:
    facts = {"gain": GOOD, "placebo_p": 0.0, "share_of_ceiling": 1.0, "remainder_p": 0.5} | changes
    return Judged(effect, evidence, **facts)  # type: ignore[arg-type]


CLEAR = Findings(True, [judged()], 5.0, rules=NUMBERS)
MANY = [judged(), judged("bone_motion", 18.3), *(judged(f"rival{k}", 17.5) for k in range(3))]

# Rule -> findings that it decides, verdict, candidates, and findings with one fact changed that it does not decide.
CASES: dict[str, tuple[Findings, str, tuple[str, ...], Findings]] = {
    "nothing_told": (
        replace(CLEAR, detected=False, told=False),
        "ambiguous",
        (),
        replace(CLEAR, detected=False, told=True),
    ),
    "no_gap": (replace(CLEAR, detected=False), "none", (), CLEAR),
    "two_effects": (replace(CLEAR, pair=(PAIR, 24.0)), "ambiguous", PAIR, replace(CLEAR, pair=(PAIR, 22.0))),
    "unnamed_fits_better": (
        replace(CLEAR, unknown=25.0),
        "ambiguous",
        ("prestress",),
        replace(CLEAR, unknown=25.0, judged=[judged(share_of_ceiling=0.85)]),
    ),
    "nothing_named": (
        replace(CLEAR, unknown=25.0, judged=[judged(share_of_ceiling=0.85)]),
        "unknown",
        (),
        replace(CLEAR, unknown=24.0, judged=[judged(share_of_ceiling=0.85)]),
    ),
    "too_little_closed": (
        replace(CLEAR, judged=[judged(share_of_ceiling=0.4, remainder_p=0.001)]),
        "unknown",
        (),
        replace(CLEAR, judged=[judged(share_of_ceiling=0.4, remainder_p=0.1)]),
    ),
    "several_effects": (
        replace(CLEAR, judged=[judged(), judged("inclusion", 19.0)]),
        "ambiguous",
        ("prestress", "inclusion"),
        replace(CLEAR, judged=[judged(), judged("inclusion", 18.0)]),
    ),
    "unnamed_as_likely": (replace(CLEAR, unknown=21.0), "ambiguous", ("prestress",), replace(CLEAR, unknown=19.0)),
    "not_predicted": (
        replace(CLEAR, judged=[judged(placebo_p=0.1)]),
        "ambiguous",
        ("prestress",),
        replace(CLEAR, judged=[judged(gain=SMALL_GAIN, placebo_p=0.04)]),
    ),
    "not_sure": (
        replace(CLEAR, judged=MANY),
        "ambiguous",
        PAIR[:1] + ("bone_motion",),
        replace(CLEAR, judged=MANY[:2]),
    ),
    "smaller_part": (
        replace(CLEAR, judged=[judged(share_of_ceiling=0.4)]),
        "ambiguous",
        ("prestress",),
        replace(CLEAR, judged=[judged(share_of_ceiling=0.6)]),
    ),
    "unlike_its_name": (replace(CLEAR, judged=[judged(unlike="it pulls")]), "ambiguous", ("prestress",), CLEAR),
    "something_left": (
        replace(CLEAR, judged=[judged(remainder_p=0.03, share_of_ceiling=0.7)]),
        "ambiguous",
        ("prestress",),
        replace(CLEAR, judged=[judged(remainder_p=0.03, share_of_ceiling=0.95)]),
    ),
    "explained": (CLEAR, "prestress", ("prestress",), replace(CLEAR, detected=False)),
}


def test_every_row_has_a_case_and_a_name_of_its_own() -> None:
    assert [rule.name for rule in RULES] == list(CASES)
    assert [rule.name for rule in BODY_RULES] == list(BODY_CASES)
    assert len({rule.sentence for rule in RULES}) == len(RULES)


@pytest.mark.parametrize("name", CASES)
def test_a_row_decides(name: str) -> None:
    findings, verdict, candidates, otherwise = CASES[name]
    told = findings.told
    found = decide(findings.detected, findings.judged, findings.unknown, findings.pair, told=told, rules=NUMBERS)
    assert (found.decided_by, found.verdict, found.candidates) == (name, verdict, candidates)
    assert found.why == ("it pulls" if name == "unlike_its_name" else {r.name: r.sentence for r in RULES}[name])
    assert first_that_holds(RULES, otherwise).rule != name


def test_rows_are_tried_in_order() -> None:
    """Findings that every row but the last but one would decide, mended one after the other."""
    worst = [
        judged(gain=GOOD, remainder_p=0.001, unlike="it pulls"),
        judged("inclusion", 19.9),
    ]
    findings = Findings(False, worst, 30.0, (PAIR, 40.0), told=False, rules=NUMBERS)
    asked = []
    mends: list[Callable[[Findings], Findings]] = [
        lambda f: replace(f, told=True),
        lambda f: replace(f, detected=True),
        lambda f: replace(f, pair=None),
        lambda f: replace(f, judged=[replace(worst[0], gain=LOSS, share_of_ceiling=0.4), worst[1]]),
        lambda f: replace(f, unknown=21.0),
        lambda f: replace(f, judged=[replace(f.judged[0], remainder_p=0.03), worst[1]]),
        lambda f: replace(f, judged=f.judged[:1]),
        lambda f: replace(f, unknown=5.0),
        lambda f: replace(f, judged=[replace(f.judged[0], gain=GOOD)]),
        lambda f: replace(f, judged=[replace(f.judged[0], share_of_ceiling=0.7)]),
        lambda f: replace(f, judged=[replace(f.judged[0], unlike="")]),
        lambda f: replace(f, judged=[replace(f.judged[0], remainder_p=0.5)]),
    ]
    for mend in mends:
        asked.append(first_that_holds(RULES, findings).rule)
        findings = mend(findings)
    asked.append(first_that_holds(RULES, findings).rule)
    assert asked == [name for name in CASES if name != "not_sure"]


def rival(effect: str = "inclusion", evidence: float = 20.0, predicts: bool = True) -> Rival:
    return cast(Rival, SimpleNamespace(effect=SimpleNamespace(id=effect), log_evidence=evidence, predicts=predicts))


BODY = BodyFindings(True, [rival()], 5.0, False, rules=NUMBERS)
HEAVY = BodyFindings(False, [rival("gravity_change", 0.0)], 0.0, True, rules=NUMBERS)
BODY_CASES: dict[str, tuple[BodyFindings, str, tuple[str, ...], BodyFindings]] = {
    "gravity_absorbed": (HEAVY, "ambiguous", ("gravity_change",), replace(HEAVY, gravity_unmodelled=False)),
    "no_gap": (replace(BODY, detected=False), "none", (), BODY),
    "nothing_named": (replace(BODY, unnamed=24.0), "unknown", (), replace(BODY, unnamed=21.0)),
    "several_effects": (
        replace(BODY, rivals=[rival(), rival("bone_motion", 19.0)]),
        "ambiguous",
        ("inclusion", "bone_motion"),
        replace(BODY, rivals=[rival(), rival("bone_motion", 18.0)]),
    ),
    "not_predicted": (replace(BODY, rivals=[rival(predicts=False)]), "ambiguous", ("inclusion",), BODY),
    "explained": (BODY, "inclusion", ("inclusion",), replace(BODY, detected=False)),
}


@pytest.mark.parametrize("name", BODY_CASES)
def test_a_row_decides_on_a_body(name: str) -> None:
    findings, verdict, candidates, otherwise = BODY_CASES[name]
    found = first_that_holds(BODY_RULES, findings)
    assert (found.rule, found.verdict, found.candidates) == (name, verdict, candidates)
    assert first_that_holds(BODY_RULES, otherwise).rule != name


# Numbers other than the program's -> findings that they decide by another row.
OTHER: list[tuple[dict[str, float], Findings, str, str]] = [
    ({"tied": 50.0}, replace(CLEAR, judged=MANY[:2]), "explained", "several_effects"),
    ({"prior_unknown": 0.999999}, replace(CLEAR, unknown=15.0), "explained", "unnamed_fits_better"),
    ({"nearly_all": 0.8}, CASES["nothing_named"][0], "nothing_named", "unnamed_fits_better"),
    ({"placebo_level": 0.02}, replace(CLEAR, judged=[judged(placebo_p=0.04)]), "explained", "not_predicted"),
    ({"placebo_level": 0.2}, replace(CLEAR, judged=[judged(placebo_p=0.1)]), "not_predicted", "explained"),
    ({"sure": 0.9}, replace(CLEAR, judged=MANY[:2]), "explained", "not_sure"),
    ({"half": 0.3}, replace(CLEAR, judged=[judged(share_of_ceiling=0.4)]), "smaller_part", "explained"),
    ({"left_over": 0.01}, CASES["something_left"][0], "something_left", "explained"),
    ({"nearly_all": 0.6}, CASES["something_left"][0], "something_left", "explained"),
    ({"remainder_level": 1e-4}, CASES["too_little_closed"][0], "too_little_closed", "smaller_part"),
    ({"tied_twins": 1e3}, CASES["two_effects"][0], "two_effects", "explained"),
    (
        {"twins": 0.99},
        replace(CLEAR, judged=[judged(), judged("a", 17.8, cosine=0.98)]),
        "several_effects",
        "explained",
    ),
]


@pytest.mark.parametrize(("changes", "findings", "usual", "other"), OTHER)
def test_other_numbers_decide_otherwise(changes: dict[str, float], findings: Findings, usual: str, other: str) -> None:
    assert first_that_holds(RULES, findings).rule == usual
    assert first_that_holds(RULES, replace(findings, rules=replace(NUMBERS, **changes))).rule == other  # type: ignore[arg-type]
