"""What the variants of one effect say of it together."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import logsumexp

from palpate.core.diagnose.detection.score_test import Screened
from palpate.core.diagnose.refit.refit import Refit
from palpate.core.diagnose.refit.variants import corrected, of_all
from palpate.core.diagnose.verdict.model_average import over_variants
from palpate.core.inference.evidence import mean_of_exponentials, score


def looked_at(*first: float) -> Screened:
    """An effect whose variants 0, 1, ... a first look gave these log evidences."""
    scores = [SimpleNamespace(log_evidence=v) for v in first]
    variants = list(range(len(first)))
    return Screened(None, variants, scores, [], mean_of_exponentials(np.array(first)))  # type: ignore[arg-type]


def refitted(which: int, own: float) -> Refit:
    hypothesis, nothing = SimpleNamespace(variant=which, effect=None), np.zeros(0)
    return Refit(hypothesis, None, nothing, nothing, own, own, nothing, nothing)  # type: ignore[arg-type]


def fitted(which: int, own: float, theta: float) -> Refit:
    bounds = np.array([[-20.0, 20.0]])
    scene = SimpleNamespace(parameters=SimpleNamespace(bounds=bounds))
    point = SimpleNamespace(theta=np.array([theta]), first=SimpleNamespace(scene=scene))
    found = refitted(which, own)
    return replace(found, linearisation=point, covariance=np.array([[0.09]]), beyond=np.zeros(1))  # type: ignore[arg-type]


def test_all_variants_refitted_count_with_their_own_evidence() -> None:
    together = of_all([refitted(0, 4.0), refitted(1, 6.0), refitted(2, 1.0)], looked_at(3.0, 2.0, 1.5))
    assert together.log_evidence == pytest.approx(np.log(np.mean(np.exp([4.0, 6.0, 1.0]))))
    assert together.hypothesis.variant == 1
    assert [f.own_evidence for f in together.others] == [4.0, 1.0]


def test_the_best_variant_is_the_one_with_the_most_evidence_not_with_the_largest_gain() -> None:
    """The second gained 3 and has 4; the first gained nothing and has 5."""
    together = of_all([refitted(0, 5.0), refitted(1, 4.0)], looked_at(5.0, 1.0))
    assert together.hypothesis.variant == 0


def test_variants_that_were_not_refitted_count_with_their_first_look() -> None:
    """Of 50 places for a push two were refitted, and gained 4 and 1; the others gain nothing by that."""
    first = [5.0, 4.5, *np.full(48, 0.5)]
    together = of_all([refitted(0, 9.0), refitted(1, 5.5)], looked_at(*first))
    now = [9.0, 5.5, *np.full(48, 0.5)]
    assert together.log_evidence == pytest.approx(logsumexp(now) - np.log(50.0))


def test_a_pair_pays_for_the_variants_of_both() -> None:
    pair = replace(looked_at(5.0), paid=3.0)
    assert of_all([refitted(0, 9.0)], pair).log_evidence == pytest.approx(6.0)


def test_variants_are_ordered_by_the_evidence_that_is_averaged_over_the_noise() -> None:
    scores = [score(np.ones(4), np.zeros((4, 0)), np.eye(4)[:, k : k + 1], np.ones(1)) for k in range(3)]
    seen = Screened(None, [0, 1, 2], scores, [np.full((4, 1), k) for k in range(3)], 0.0)  # type: ignore[arg-type, list-item]
    found = seen.weighed(np.array([1.0, 3.0, 2.0]))
    assert found.variants == [1, 2, 0]
    assert [s.log_evidence for s in found.scores] == [3.0, 2.0, 1.0]
    assert [d[0, 0] for d in found.directions] == [1, 2, 0]
    assert found.log_evidence == pytest.approx(mean_of_exponentials(np.array([1.0, 2.0, 3.0])))


def test_a_better_element_s_correction_of_the_best_variant_is_all_variants() -> None:
    screened = looked_at(3.0, 2.0, 1.5)
    found = of_all([refitted(0, 4.0), refitted(1, 6.0)], screened)
    again = corrected(refitted(1, 5.2), found, screened)
    assert again.own_evidence == 5.2
    assert again.log_evidence == pytest.approx(found.log_evidence - 0.8)
    assert [f.own_evidence for f in again.others] == [pytest.approx(3.2)]


def test_a_twin_keeps_its_weight_in_the_stiffness_when_the_best_variant_is_corrected() -> None:
    """Softer tissue on the left and stiffer on the right are one contrast, and say two stiffnesses."""
    screened = looked_at(3.0, 3.0)
    found = of_all([fitted(0, 28.1, np.log(5.0)), fitted(1, 28.1, np.log(45.0))], screened)
    before, _ = over_variants(found)
    for gained in (14.0, -3.0):
        again = corrected(fitted(0, 28.1 + gained, np.log(5.0)), found, screened)
        mean, covariance = over_variants(again)
        assert mean == pytest.approx(before)
        assert covariance[0, 0] == pytest.approx(0.09 + (0.5 * np.log(9.0)) ** 2)
