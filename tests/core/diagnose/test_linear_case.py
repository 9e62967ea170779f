"""Refits, pairs and the comparison of a linear case, whose evidence has a closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from linear_case import BOUNDS, LinearCase, N, column, effect, free_field
from scipy.special import logsumexp

from palpate.core.diagnose.comparison import compared
from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.posterior import NONE, UNKNOWN, log_prior
from palpate.core.diagnose.refit.pairs import _Pair, refit_pairs
from palpate.core.diagnose.refit.refit import refit, refit_corrected
from palpate.core.diagnose.refit.variants import refit_variants
from palpate.core.diagnose.verdict.judge import plain_model, remainder_p
from palpate.core.diagnose.verdict.ranking import ranking
from palpate.core.diagnose.verdict.true_error import NoiseOfPoints
from palpate.core.errors import ConvergenceError
from palpate.core.inference.posterior import prior_precision
from palpate.core.inference.restricted_likelihood import restricted
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.optimum import best_of, solved

RULES = DecisionRules()
A, B, C, D = (column(seed, 0.35) for seed in (1, 2, 3, 4))
# What a prior of the stiffness about the optimum instead of about the plain fit may change, in the logarithm.
CLOSE = 0.02


def one_of(*names: str, hidden: np.ndarray | None = None, **model: tuple[str, ...]) -> LinearCase:
    columns = {"a": A, "b": B, "c": C, "d": D}
    return LinearCase.of([effect(n, columns[n]) for n in names], np.zeros(N) if hidden is None else hidden, **model)


def test_a_refit_ends_at_the_least_squares_of_data_and_prior() -> None:
    case = LinearCase.of([effect("ab", np.hstack([A, B]), scale=0.8)], 2.0 * A[:, 0] - 1.5 * B[:, 0])
    found = refit(case.fit, case.looked_at("ab"), tolerance=1e-6)
    assert found is not None
    W = np.linalg.inv(case.covariance)
    X, r = np.hstack([case.fit.linearisation.in_theta, A, B]), case.fit.linearisation.residual
    flat = np.diag([0.0, 0.0, 0.8**-2, 0.8**-2])
    best = -np.linalg.solve(X.T @ W @ X + flat, X.T @ W @ r)
    assert found.linearisation.theta == pytest.approx(case.fit.linearisation.theta + best[:2], abs=1e-5)
    assert found.phi == pytest.approx(best[2:], abs=1e-5)
    assert found.phi == pytest.approx([2.0, -1.5], abs=0.5)
    precision = X.T @ W @ X + np.diag([*prior_precision(BOUNDS), 0.8**-2, 0.8**-2])
    assert found.covariance == pytest.approx(np.linalg.inv(precision))
    assert found.sd_phi == pytest.approx(np.sqrt(np.diag(np.linalg.inv(precision)))[2:])
    assert found.own_evidence == pytest.approx(case.evidence(np.hstack([A, B]), np.full(2, 0.8)), abs=CLOSE)
    assert found.log_evidence == found.own_evidence
    assert not found.beyond.any()
    assert found.in_phi == pytest.approx(np.hstack([A, B]))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_effect_of_one_sign_gains_where_the_data_have_it_and_ends_at_nothing_where_not(sign: float) -> None:
    case = LinearCase.of([effect("a", A, low=0.0)], sign * 2.0 * A[:, 0])
    either = case.evidence(A, np.ones(1))
    found = refit(case.fit, case.looked_at("a"))
    assert found is not None
    if sign > 0.0:
        assert found.own_evidence == pytest.approx(either + np.log(2.0), abs=CLOSE)
    else:
        assert found.phi == pytest.approx([0.0], abs=1e-9)
        assert found.own_evidence < -1.0


def test_a_stiffness_that_wants_out_of_its_bounds_is_held_and_says_how_far() -> None:
    case = one_of("a", hidden=3.0 * A[:, 0])
    J = case.fit.linearisation.in_theta
    pulled = replace(case.fit.model, r=case.fit.model.r - J @ [0.0, 5.0])  # type: ignore[type-var]
    found = refit(replace(case.fit, model=pulled), case.looked_at("a"))
    assert found is not None
    assert found.linearisation.theta[1] == pytest.approx(np.log(500.0))
    assert found.beyond[0] == 0.0
    assert found.beyond[1] == pytest.approx(5.0 + np.log(60.0) - np.log(500.0), abs=0.2)


def test_the_variants_of_an_effect_count_together_and_only_likely_ones_are_refitted() -> None:
    case = LinearCase.of([effect("abcd", A, B, C, D)], 2.0 * B[:, 0])
    screened = case.looked_at("abcd")
    each = [case.evidence(S, np.ones(1)) for S in (A, B, C, D)]
    found = refit_variants(case.fit, screened, RULES)
    assert found is not None
    assert found.hypothesis.variant is not None
    assert found.hypothesis.variant.name == "abcd_1"
    assert found.others == ()  # the others are far worse
    assert found.own_evidence == pytest.approx(each[1], abs=CLOSE)
    assert found.log_evidence == pytest.approx(logsumexp(each) - np.log(4.0), abs=CLOSE)
    wide = refit_variants(case.fit, screened, replace(RULES, variants_within=1e3))
    assert wide is not None
    assert len(wide.others) == RULES.at_most - 1
    assert wide.log_evidence == pytest.approx(found.log_evidence, abs=CLOSE)


def test_a_variant_without_an_equilibrium_is_left_out_and_none_at_all_is_no_refit() -> None:
    case = LinearCase.of([effect("ab", A, B)], 2.0 * A[:, 0], unsolvable=("ab_0",))
    rules = replace(RULES, variants_within=1e3)
    found = refit_variants(case.fit, case.looked_at("ab"), rules)
    assert found is not None
    assert found.hypothesis.variant is not None
    assert found.hypothesis.variant.name == "ab_1"
    case = LinearCase.of([effect("ab", A, B)], 2.0 * A[:, 0], unsolvable=("ab_0", "ab_1"))
    assert refit_variants(case.fit, case.looked_at("ab"), rules) is None


@pytest.mark.parametrize("remeshed", [True, False])
def test_only_a_refit_on_another_stress_free_mesh_is_capped(remeshed: bool) -> None:
    case = one_of("a", hidden=3.0 * A[:, 0], remeshed=("a_0",) if remeshed else ())
    screened = replace(case.looked_at("a"), log_evidence=1.5)
    found = refit_variants(case.fit, screened, RULES)
    assert found is not None
    assert found.own_evidence > 5.0
    assert found.log_evidence == (1.5 if remeshed else pytest.approx(found.own_evidence))


def test_a_better_element_s_correction_is_data_for_the_refit() -> None:
    """A correction that looks like a third of the effect is taken from it, in a refit that goes on from where the first one ended."""
    case = LinearCase.of([effect("a", A, scale=2.0)], 3.0 * A[:, 0])
    screened = case.looked_at("a")
    first = refit(case.fit, screened, tolerance=1e-6)
    assert first is not None
    asked = case.fit.model.solved  # type: ignore[attr-defined]
    asked.clear()
    correction = replace(ElementCorrection.none(N), value=1.0 * A[:, 0])
    again = refit_corrected(case.fit, screened, first, correction, tolerance=1e-6)
    assert again is not None
    assert again.correction is correction
    assert asked[0] == pytest.approx([*first.linearisation.theta, *first.phi])
    white = case.fit.weighting.whiten(np.hstack([A, case.fit.linearisation.in_theta]))
    left = white[:, 0] - white[:, 1:] @ np.linalg.lstsq(white[:, 1:], white[:, 0], rcond=None)[0]
    information = float(left @ left)
    assert again.phi - first.phi == pytest.approx([-information / (information + 0.25)], abs=1e-4)


def _pairs(case: LinearCase, rules: DecisionRules = RULES) -> list[tuple[str, float]]:
    screened = case.screened
    refits = [found for s in screened if (found := refit_variants(case.fit, s, rules)) is not None]
    lead = max(refits, key=lambda f: f.log_evidence)
    factors = {f.hypothesis.effect.id: f.log_evidence for f in refits if f.hypothesis.effect is not None}
    pairs = refit_pairs(case.fit, screened, lead, {**factors, UNKNOWN: 0.0}, rules)
    return [(f.hypothesis.effect.id, f.log_evidence) for f in pairs if f.hypothesis.effect is not None]


def test_two_effects_are_weighed_as_one_model_with_both() -> None:
    case = one_of("a", "b", "c", hidden=4.0 * A[:, 0] + 2.0 * B[:, 0])
    found = dict(_pairs(case))
    assert next(iter(found)) == "a+b"
    assert found["a+b"] == pytest.approx(case.evidence(np.hstack([A, B]), np.ones(2)), abs=CLOSE)
    every = dict(_pairs(case, replace(RULES, pair_worth=0.0)))
    assert list(every) == ["a+b", "a+c"]
    assert every["a+c"] == pytest.approx(case.evidence(np.hstack([A, C]), np.ones(2)), abs=CLOSE)
    assert [name for name, _ in _pairs(case, replace(RULES, pair_worth=0.0, at_most=1))] == ["a+b"]


def test_a_pair_of_effects_with_many_places_is_the_mean_over_them_where_one_of_each_stands_out() -> None:
    """Two places of each: four pairs, of which one is far the best, pay ln 4."""
    effects = [effect("ac", A, C), effect("bd", B, D)]
    case = LinearCase.of(effects, 4.0 * A[:, 0] + 3.0 * B[:, 0])
    ((name, evidence),) = _pairs(case)
    assert set(name.split("+")) == {"ac", "bd"}
    assert evidence == pytest.approx(case.evidence(np.hstack([A, B]), np.ones(2)) - np.log(4.0), abs=0.1)


def test_a_pair_whose_second_effect_changes_the_mesh_gains_no_more_than_the_first_look_at_it() -> None:
    """The linear case's first look is exact, so that the cap takes nothing; a correction that is not of its mesh would."""
    hidden = 4.0 * A[:, 0] + 2.0 * B[:, 0]
    free, held = (one_of("a", "b", hidden=hidden, remeshed=names) for names in ((), ("a_0 and b_0",)))
    assert dict(_pairs(held))["a+b"] == pytest.approx(dict(_pairs(free))["a+b"], abs=CLOSE)


def test_the_comparison_is_bayes_theorem_over_all_hypotheses() -> None:
    case = one_of("a", "b", "c", hidden=1.6 * A[:, 0])
    unnamed = free_field(np.hstack([D, 0.5 * column(5)]))
    found = compared(case.fit, case.screened, unnamed, RULES)
    assert next(s.effect.id for s in found.screened) == "a"
    assert found.lead is not None
    assert found.lead.hypothesis.effect is not None
    assert found.lead.hypothesis.effect.id == "a"
    exact = {name: case.evidence(S, np.ones(1)) for name, S in (("a", A), ("b", B), ("c", C))}
    exact[UNKNOWN] = case.evidence(unnamed[0].S, np.ones(2))
    for f in found.pairs:
        assert f.hypothesis.effect is not None
        other = {"b": B, "c": C}[f.hypothesis.effect.id.split("+")[1]]
        exact[f.hypothesis.effect.id] = case.evidence(np.hstack([A, other]), np.ones(2))
    assert found.factors == pytest.approx(exact, abs=CLOSE)
    logs = {NONE: log_prior(NONE, 3, RULES)} | {n: log_prior(n, 3, RULES) + f for n, f in exact.items()}
    total = logsumexp(list(logs.values()))
    assert found.probability == pytest.approx({n: np.exp(v - total) for n, v in logs.items()}, abs=0.01)
    assert sum(found.probability.values()) == pytest.approx(1.0)
    assert found.test.detected
    assert found.probability["a"] > 0.5


def test_nothing_is_refitted_without_a_gap_but_what_is_known_to_act() -> None:
    case = one_of("a", "b")
    found = compared(case.fit, case.screened, free_field(C), RULES)
    assert found.test.p_value > RULES.clear
    assert (found.refits, found.pairs, found.lead) == ([], [], None)
    assert max(found.probability, key=lambda name: found.probability[name]) == NONE
    known = compared(case.fit, case.screened, free_field(C), RULES, acting=("b",))
    assert [f.hypothesis.effect.id for f in known.refits if f.hypothesis.effect is not None] == ["b"]
    assert known.test == found.test


def test_a_gap_that_is_detected_is_improved_on_before_pairs_are_looked_at() -> None:
    case = one_of("a", "b", hidden=4.0 * A[:, 0])
    seen: list[list[str]] = []

    def improve(weighed, refits, progress):  # type: ignore[no-untyped-def]
        seen.append([s.effect.id for s in weighed])
        return [replace(f, log_evidence=f.log_evidence - 1.0) for f in refits]

    plain = compared(case.fit, case.screened, free_field(C), RULES)
    found = compared(case.fit, case.screened, free_field(C), RULES, improve=improve)
    assert seen == [["a", "b"]]
    assert found.factors["a"] == pytest.approx(plain.factors["a"] - 1.0)
    assert found.factors[UNKNOWN] == plain.factors[UNKNOWN]


def test_a_gap_is_as_sure_as_the_evidence_of_what_was_refitted() -> None:
    """Draws of noise give no p-value below one in a thousand; a refit's Bayes factor does, over its share of the level."""
    case = one_of("a", "b", hidden=8.0 * A[:, 0])
    found = compared(case.fit, case.screened, free_field(C), RULES)
    of_all = logsumexp([log_prior(n, 2, RULES) + f for n, f in found.factors.items() if "+" not in n])
    assert found.test.p_value == pytest.approx(
        np.exp(-of_all) * (1.0 - RULES.prior_nothing) / RULES.refit_share, rel=1e-3
    )
    assert found.test.p_value < 1e-6


@pytest.mark.parametrize(("prior", "detected"), [(0.5, True), (0.999999, False)])
def test_a_gap_is_detected_where_a_cause_is_more_probable_than_none(prior: float, detected: bool) -> None:
    """However seldom noise leaves as much: who holds that nothing is left out needs more to be convinced."""
    case = one_of("a", "b", hidden=0.4 * A[:, 0])
    found = compared(case.fit, case.screened, free_field(C), replace(RULES, prior_nothing=prior))
    assert found.test.p_value < RULES.level
    assert found.test.detected == detected == (found.probability[NONE] < 0.5)


def test_what_a_first_look_gains_and_a_better_one_takes_back_is_no_gap() -> None:
    """The better element, solved with the effect, leaves nothing of what the effect had gained."""
    case = one_of("a", "b", hidden=0.4 * A[:, 0])
    first = compared(case.fit, case.screened, free_field(1e-3 * C), RULES)
    assert first.test.detected
    found = compared(
        case.fit,
        case.screened,
        free_field(1e-3 * C),
        RULES,
        improve=lambda weighed, refits, progress: [replace(f, log_evidence=-1.0) for f in refits],
    )
    assert found.test.p_value == first.test.p_value < RULES.level
    assert not found.test.detected and found.probability[NONE] > 0.5


def test_pairs_are_looked_for_about_the_best_effect() -> None:
    case = one_of("a", "b", "c", hidden=6.0 * B[:, 0] + 2.0 * C[:, 0])
    found = compared(case.fit, case.screened, free_field(D), replace(RULES, pair_worth=0.0))
    names = [f.hypothesis.effect.id for f in found.pairs if f.hypothesis.effect is not None]
    assert sorted(names) == ["b+a", "b+c"] and max(found.probability, key=lambda n: found.probability[n]) == "b+c"


def test_hopeless_effects_of_many_places_are_not_refitted() -> None:
    """`b` has one place, whose refit is cheap; `cd` has two."""
    case = LinearCase.of([effect("a", A), effect("b", B), effect("cd", C, D)], 8.0 * A[:, 0])
    found = compared(case.fit, case.screened, free_field(column(6)), RULES)
    assert {f.hypothesis.effect.id for f in found.refits if f.hypothesis.effect is not None} == {"a", "b"}
    every = compared(case.fit, case.screened, free_field(column(6)), replace(RULES, hopeless=1e6))
    assert len(every.refits) == 3


@pytest.mark.parametrize("left", [0.0, 2.0])
def test_what_an_effect_leaves_is_more_than_noise_where_something_is_left(left: float) -> None:
    case = one_of("a", hidden=4.0 * A[:, 0] + left * D[:, 0])
    lead = refit_variants(case.fit, case.looked_at("a"), RULES)
    assert lead is not None
    p = remainder_p(case.fit, lead, free_field(np.hstack([D, 0.5 * column(5)])), RULES, 1)
    assert p < 0.005 if left else p > 0.05


def test_a_remainder_that_the_effect_itself_can_take_up_is_none() -> None:
    """What has no name but looks like the effect itself is taken up by it, so that nothing of it is left."""
    case = one_of("a", hidden=3.0 * A[:, 0])
    lead = refit_variants(case.fit, case.looked_at("a"), RULES)
    assert lead is not None
    assert remainder_p(case.fit, lead, free_field(A), RULES, 1) > 0.05
    nothing_taken = replace(lead, linearisation=case.fit.linearisation, in_phi=np.zeros((N, 1)))
    assert remainder_p(case.fit, nothing_taken, free_field(A), RULES, 1) < 0.005


def test_the_ranking_tells_of_every_effect_what_was_found_or_looked_at() -> None:
    effects = [effect("a", A, low=0.0, scale=2.0), effect("bcd", B, C, D)]
    case = LinearCase.of(effects, 4.0 * A[:, 0])
    screened = [case.looked_at("bcd"), case.looked_at("a")]
    found = refit_variants(case.fit, screened[1], RULES)
    assert found is not None
    first, second = ranking(case.fit, screened, [found], {"a": 0.9, "bcd": 0.1}, {"a": 0.3})
    assert (first.effect, first.probability, first.cv_gain_mm, first.refitted) == ("a", 0.9, 0.3, True)
    assert first.log_evidence == found.log_evidence
    assert (first.variant, second.variant) == ("a_0", screened[0].variants[0].name)
    size = first.parameters["size_0"]
    assert (size.value, size.sd) == (pytest.approx(found.phi[0]), pytest.approx(found.sd_phi[0]))
    W = np.linalg.inv(case.covariance)
    left, all_of_it = found.linearisation.residual, case.fit.linearisation.residual
    assert first.residual_share == pytest.approx((left @ W @ left) / (all_of_it @ W @ all_of_it))
    assert (second.effect, second.refitted, second.cv_gain_mm, second.residual_share) == ("bcd", False, 0.0, 1.0)
    looked = screened[0].scores[0]
    assert second.log_evidence == screened[0].log_evidence
    assert second.parameters["size_0"].value == pytest.approx(looked.estimate[0])
    assert second.parameters["size_0"].sd == pytest.approx(np.sqrt(looked.covariance[0, 0]))
    assert second.p_value == pytest.approx(min(1.0, 3.0 * looked.p_value))
    # Without a refit the evidence orders them, and no p-value is above 1.
    rows = ranking(case.fit, screened, [], {}, {})
    assert [row.effect for row in rows] == ["a", "bcd"]
    assert [(row.probability, row.cv_gain_mm) for row in rows] == [(0.0, 0.0)] * 2
    sure = replace(screened[0], scores=[replace(s, p_value=0.9) for s in screened[0].scores])
    assert ranking(case.fit, [sure], [], {}, {})[0].p_value == 1.0


def test_what_a_model_errs_by_is_the_normal_given_what_was_seen_of_it() -> None:
    case, m = one_of("a"), 8
    fit, half, rng = case.fit, 0.5 * case.covariance, np.random.default_rng(2)
    reader = np.eye(N)[:m]
    points = NoiseOfPoints(fit, np.eye(m), reader, fit.noise, A, lambda sizes: half)
    left_out, model = rng.standard_normal(m), plain_model(fit)
    W = np.linalg.inv(case.covariance)
    J = fit.linearisation.in_theta
    of_parameters = J @ np.linalg.inv(J.T @ W @ J + np.diag(prior_precision(BOUNDS))) @ J.T
    nugget = fit.options.patch_nugget_mm**2 * np.eye(m)

    def given(gap: float) -> tuple[np.ndarray, np.ndarray]:
        error = (half + gap**2 * A @ A.T + of_parameters)[:m, :m]
        gain = error @ np.linalg.inv(error + half[:m, :m] + nugget)
        return gain @ left_out, error - gain @ error

    found = points.error_of(model, left_out, (0.0, 0.2))
    each = [_log_likelihood(case, gap) for gap in (0.0, 0.2)]
    np.testing.assert_allclose(found.weights, np.exp(each - logsumexp(each)))
    for (mean, factor), gap in zip(found.parts, (0.0, 0.2), strict=True):
        np.testing.assert_allclose(mean, given(gap)[0])
        np.testing.assert_allclose(factor @ factor.T, given(gap)[1], atol=1e-12)
    assert found.floor_mm2 == pytest.approx(np.trace(half[:m, :m]) / m)
    drawn = found.draws(100_000, np.random.default_rng(1))
    expected = sum(w * mean for w, (mean, _) in zip(found.weights, found.parts, strict=True))
    np.testing.assert_allclose(drawn.mean(axis=0), expected, atol=0.01)


def _log_likelihood(case: LinearCase, gap: float) -> float:
    """Restricted log likelihood of the plain model's residual with a gap of that size."""
    fit = case.fit
    return restricted(case.covariance + gap**2 * A @ A.T, fit.linearisation.residual, fit.linearisation.in_theta)


def test_the_plain_optimum_is_the_same_from_every_start() -> None:
    case = one_of("a")
    fit, told = case.fit, list[float]()
    starts = np.log([[6.0, 400.0], [50.0, 7.0], [20.0, 60.0]])
    found = best_of(fit.model, fit.weighting, starts, fit.linearisation, lambda share, words: told.append(share))
    assert found.linearisation.theta == pytest.approx(fit.linearisation.theta, abs=2e-3)
    assert found.ends.shape == (3, 2)
    assert found.agree(slice(0, 2))
    lowest = fit.weighting.squared(fit.linearisation.residual)
    assert found.history[-1] == pytest.approx(lowest, rel=1e-3)
    assert found.history == sorted(found.history, reverse=True)
    assert told == sorted(told) and told[0] >= 0.0 and told[-1] < 1.0
    apart = replace(found, ends=np.vstack([found.ends, found.ends[:1] + [0.0, 0.06]]))
    assert not apart.agree(slice(0, 2)) and apart.agree(slice(0, 1))


def test_the_best_of_all_starts_counts_and_one_without_an_equilibrium_does_not() -> None:
    """Stiffer than 100 kPa on the left, the model has no equilibrium."""
    case = one_of("a")
    fit = case.fit

    class Shy(type(fit.model)):  # type: ignore[misc]
        def plain(self, theta: np.ndarray, near: object) -> object:
            return None if theta[0] > np.log(100.0) else super().plain(theta, near)

    shy = Shy(fit.model.r, fit.model.J, fit.model.theta, fit.model.correction)  # type: ignore[attr-defined]
    starts = np.log([[300.0, 60.0], [15.0, 50.0]])
    found = best_of(shy, fit.weighting, starts, fit.linearisation)
    assert len(found.ends) == 1
    assert found.linearisation.theta == pytest.approx(fit.linearisation.theta, abs=2e-3)
    with pytest.raises(ConvergenceError, match="no start of Gauss-Newton could be solved"):
        best_of(shy, fit.weighting, starts[:1], fit.linearisation)
    with pytest.raises(ConvergenceError, match="the rest anatomy cannot be deformed"):
        solved(shy, starts[0], None)


def test_the_first_look_at_a_pair_is_exact_where_the_model_is_linear() -> None:
    """The second effect looks a little like a change of stiffness, which moves with it."""
    like = B + 0.05 * one_of("a").fit.linearisation.in_theta[:, :1]
    case = LinearCase.of([effect("a", A), effect("b", like)], 4.0 * A[:, 0] + 2.0 * like[:, 0])
    lead = refit_variants(case.fit, case.looked_at("a"), RULES)
    assert lead is not None
    alone = _Pair.of(case.fit, lead, case.looked_at("b")).alone
    assert alone.log_evidence == pytest.approx(case.evidence(np.hstack([A, like]), np.ones(2)), abs=CLOSE)
    assert alone.paid == pytest.approx(0.0, abs=1e-9)
