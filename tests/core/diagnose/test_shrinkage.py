"""How far a gap shrinks, on arrays: data left out, which effect each draw takes, the ceiling, the parts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from organ_case import organ_case

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.posterior import log_prior
from palpate.core.diagnose.verdict import shrinkage as module
from palpate.core.diagnose.verdict.shrinkage import shrinkage
from palpate.core.diagnose.verdict.stiffness_with_effect import leading, with_stiffness
from palpate.core.diagnose.verdict.true_error import TrueError

RULES = DecisionRules()
FLOOR_MM = 0.2
# Four rows of the organ, two beside it. A model is its name here; each leaves a share of what the plain one leaves.
BEFORE = np.array([2.0, -1.0, 1.0, 0.5, 3.0, -3.0])
LEAVES = {"a": 0.2, "b": 0.6, "ceiling": 0.1, "a+b": 0.15}
SPLIT = SimpleNamespace(organ=slice(0, 4), parts={"surface": slice(0, 4), "tissue": slice(4, 6)})


def refit(name: str, log_evidence: float) -> Any:
    return SimpleNamespace(
        hypothesis=SimpleNamespace(effect=SimpleNamespace(id=name)), log_evidence=log_evidence, name=name
    )


def diagnosis(**log_evidence: float) -> Any:
    found = [refit(name, value) for name, value in log_evidence.items()]
    return SimpleNamespace(
        fit=organ_case(),
        split=SPLIT,
        rules=RULES,
        forces=SimpleNamespace(free=None),
        left_out={"": BEFORE} | {name: share * BEFORE for name, share in LEAVES.items()},
        refits=[f for f in found if "+" not in f.name],
        pairs=[f for f in found if "+" in f.name],
        screened=[None, None],
        placebo=0.07,
    )


@pytest.fixture(autouse=True)
def told_exactly(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, tuple[float, ...]]]:
    """A drawing without noise: what was left out is the error. The models whose error was asked for, and with which gaps."""
    asked: list[tuple[str, tuple[float, ...]]] = []

    class Exact:
        @staticmethod
        def of(fit: object, split: object, free: object) -> Exact:
            return Exact()

        def error_of(self, model: str, left_out: FloatArray, gaps: tuple[float, ...]) -> TrueError:
            asked.append((model, gaps))
            return TrueError(np.ones(1), [(left_out, np.zeros((4, 4)))], np.eye(4), np.array([FLOOR_MM**2]))

    monkeypatch.setattr(module, "NoiseOfPoints", Exact)
    monkeypatch.setattr(module, "effect_model", lambda f: f.name)
    monkeypatch.setattr(module, "saturated_model", lambda fit, forces: "ceiling")
    return asked


def test_the_share_that_is_gone_is_one_minus_the_ratio_of_root_mean_squares() -> None:
    case = diagnosis(a=10.0)
    found = shrinkage(case, case.refits[0])
    assert found.held_out_rms_before_mm == pytest.approx(1.25)
    assert found.held_out_rms_after_mm == pytest.approx(0.25)
    assert found.fraction == found.noise_corrected_fraction == pytest.approx(0.8)
    assert found.ci95 == pytest.approx((0.8, 0.8))
    assert found.ceiling_fraction == pytest.approx(0.9)
    assert found.placebo_fraction == 0.07
    assert found.noise_floor_mm == pytest.approx(FLOOR_MM)
    assert found.effect == "a"


def test_every_part_has_its_own_figures() -> None:
    case = diagnosis(a=10.0)
    parts = shrinkage(case, case.refits[0]).parts
    assert isinstance(parts, dict)
    assert parts["surface"].before_mm == pytest.approx(1.25)
    assert (parts["tissue"].before_mm, parts["tissue"].after_mm) == pytest.approx((3.0, 0.6))
    assert parts["tissue"].ceiling_mm == pytest.approx(0.3)


def test_a_field_that_is_its_own_gap_leaves_no_further_one(told_exactly: list[tuple[str, tuple[float, ...]]]) -> None:
    case = diagnosis(a=10.0)
    shrinkage(case, case.refits[0])
    gaps = dict(told_exactly)
    assert gaps["ceiling"] == (0.0,) and gaps["a"] == case.fit.options.gap_sizes


def test_the_interval_is_over_all_effects_by_their_probability() -> None:
    """Two that are equally probable, one that is not: the interval goes from one's share to the other's, or is that of one."""
    case = diagnosis(a=10.0, b=10.0)
    assert shrinkage(case, case.refits[0]).ci95 == pytest.approx((0.4, 0.8))
    rare = diagnosis(a=10.0, b=10.0 + np.log(0.01))
    assert shrinkage(rare, rare.refits[0]).ci95 == pytest.approx((0.8, 0.8))
    other = diagnosis(a=10.0, b=20.0)
    found = shrinkage(other, other.refits[0])
    assert found.ci95 == pytest.approx((0.4, 0.4)) and found.noise_corrected_fraction == pytest.approx(0.8)


def test_two_effects_together_count_by_their_own_prior() -> None:
    """A pair whose evidence makes up for its prior is as probable as a single effect."""
    dear = log_prior("a", 2, RULES) - log_prior("a+b", 2, RULES)
    case = diagnosis(b=10.0, **{"a+b": 10.0 + dear})
    assert shrinkage(case, case.refits[0]).ci95 == pytest.approx((0.4, 0.85))
    cheap = diagnosis(b=10.0, **{"a+b": 10.0 + dear - np.log(100.0)})
    assert shrinkage(cheap, cheap.refits[0]).ci95 == pytest.approx((0.4, 0.4))


@pytest.mark.parametrize(
    ("probability", "name"),
    [({"a": 0.2, "b": 0.7}, "b"), ({"a": 0.2, "a+b": 0.7}, "a+b"), ({"unknown": 1.0}, "a")],
)
def test_the_most_probable_of_what_was_refitted_leads(probability: dict[str, float], name: str) -> None:
    case = diagnosis(a=1.0, b=1.0, **{"a+b": 1.0})
    case.verdict = SimpleNamespace(probability=probability)
    lead = leading(case)
    assert lead is not None and lead.hypothesis.effect is not None and lead.hypothesis.effect.id == name
    case.refits = case.pairs = []
    assert leading(case) is None


@pytest.mark.parametrize("verdict", ["none", "unknown"])
def test_no_stiffness_is_looked_for_with_an_effect_that_is_not_named(verdict: str) -> None:
    case = diagnosis(a=1.0)
    case.verdict = SimpleNamespace(probability={"a": 1.0}, verdict=verdict)
    assert with_stiffness(case) is case
