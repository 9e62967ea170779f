"""Score tests, evidence, the gap test and the verdict on small linear problems whose answers are known."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy import integrate, stats

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection import gap_test as tests
from palpate.core.diagnose.detection.gap_test import EffectDirections
from palpate.core.diagnose.effects import library
from palpate.core.diagnose.verdict import decide as decisions
from palpate.core.diagnose.verdict.verdict import Judged, probabilities
from palpate.core.inference.evidence import allowed, explained, mean_of_exponentials, projected, score
from palpate.core.inference.heldout import Gain
from palpate.core.residual.covariance_family import CovarianceFamily
from palpate.core.residual.noise_covariance import NoiseSizes
from palpate.core.residual.noise_estimation import NoiseGrid
from palpate.core.residual.noise_model_options import NoiseModelOptions

N, T = 40, 2
RNG = np.random.default_rng(5)
J = RNG.standard_normal((N, T))
S = RNG.standard_normal((N, 3))
FIELDS = RNG.standard_normal((N, 12))
SCALES = np.array([0.5, 1.0, 2.0])
ANYWHERE = np.tile([-np.inf, np.inf], (3, 1))
NUMBERS = NoiseModelOptions()
RULES = DecisionRules()
gap_test, decide = partial(tests.gap_test, rules=RULES), partial(decisions.decide, rules=RULES)
SIZES = NoiseSizes.of(NUMBERS)
WHITE = NoiseGrid([SIZES], CovarianceFamily.one(np.eye(N)), np.zeros(1), NUMBERS)
LOOK = {"a": EffectDirections([S], SCALES, ANYWHERE)}


def log_density(r: np.ndarray, columns: np.ndarray) -> float:
    """Of r ~ N(0, I + columns columns' + 1e8 J J'): the stiffness has a flat prior."""
    C = np.eye(N) + columns @ columns.T + 1e8 * J @ J.T
    return float(stats.multivariate_normal(cov=C, allow_singular=False).logpdf(r))


def test_evidence_is_the_ratio_of_marginal_likelihoods() -> None:
    r = RNG.standard_normal(N) + S @ [0.4, -0.8, 1.5]
    expected = log_density(r, S * SCALES) - log_density(r, np.zeros((N, 1)))
    assert score(r, J, S, SCALES).log_evidence == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("phi", [-2.0, 0.1, 0.6, 4.0])
def test_evidence_of_an_effect_with_bounds_is_an_integral_between_them(phi: float) -> None:
    """One parameter, scale 0.5, from 0 to 0.8; against quadrature, also where the data ask for what is not allowed."""
    r, one, scale, bounds = (
        np.random.default_rng(3).standard_normal(N) - phi * S[:, 0],
        S[:, :1],
        SCALES[:1],
        (0.0, 0.8),
    )
    a, b = projected(J, one)[:, 0], projected(J, r)
    prior = stats.truncnorm(bounds[0] / 0.5, bounds[1] / 0.5, scale=0.5)
    value = integrate.quad(lambda x: np.exp(-0.5 * (2.0 * x * a @ b + x**2 * a @ a)) * prior.pdf(x), *bounds)[0]
    found = score(r, J, one, scale, np.array([bounds]))
    assert found.log_evidence == pytest.approx(np.log(value), abs=1e-6)
    look = {"a": EffectDirections([one], scale, np.array([bounds]))}
    seen = gap_test(WHITE, r, J, FIELDS, look)
    again = gap_test(WHITE, r, J, FIELDS, look, refitted={"a": found.log_evidence - 1e-9})
    # the refit says the same: all that changes is what two looks cost
    if again.p_value > 0.001:
        assert again.p_value == pytest.approx(min(1.0, seen.p_value / (1.0 - RULES.refit_share)))
    assert again.p_value <= min(1.0, seen.p_value / (1.0 - RULES.refit_share))


def test_an_effect_that_can_only_go_one_way_gains_ln_2_where_the_data_agree() -> None:
    bounds, scale = np.array([[0.0, np.inf]]), np.ones(1)
    assert allowed(np.array([5.0]), np.array([0.5]), scale, bounds) == pytest.approx(np.log(2.0))
    assert allowed(np.array([0.0]), np.array([0.5]), scale, bounds) == pytest.approx(0.0)
    assert allowed(np.array([-20.0]), np.array([0.5]), scale, bounds) < -700.0
    assert allowed(np.array([5.0]), np.array([0.5]), scale, np.array([[-np.inf, np.inf]])) == 0.0


def test_an_effect_that_the_stiffness_can_imitate_has_no_evidence() -> None:
    found = score(RNG.standard_normal(N), J, J @ np.array([[1.0], [2.0]]), np.ones(1))
    assert found.log_evidence == pytest.approx(0.0, abs=1e-9)
    assert np.abs(projected(J, J)).max() < 1e-12


def test_the_score_finds_the_amplitude_that_was_put_in() -> None:
    phi = np.array([0.3, -0.5, 1.0])
    found = score(-50.0 * S @ phi + 30.0 * J[:, 0], J, 50.0 * S, SCALES)
    np.testing.assert_allclose(found.estimate, phi, atol=5e-3)


def test_the_score_statistic_is_chi_squared_without_an_effect() -> None:
    values = [score(RNG.standard_normal(N), J, S, SCALES).p_value for _ in range(300)]
    assert stats.kstest(values, "uniform").pvalue > 0.01


def test_gap_p_values_of_cases_without_an_effect_are_uniform() -> None:
    """200 cases: of the three looks together, and of each by itself."""
    one_way = EffectDirections([S[:, :1], FIELDS[:, :1]], SCALES[:1], np.array([[0.0, 3.0]]))
    named = {"one way": one_way, "both ways": EffectDirections([S[:, 1:]], SCALES[1:], ANYWHERE[1:])}
    found = [
        gap_test(WHITE, np.random.default_rng([7, k]).standard_normal(N), J, FIELDS, named, seed=1000 + k)
        for k in range(200)
    ]
    assert stats.kstest([t.p_value for t in found], "uniform").pvalue > 0.05
    for name in ("p_whole", "p_smooth", "p_named"):
        assert stats.kstest([getattr(t, name) for t in found], "uniform").pvalue > 0.05 / 3, name  # three looks
    assert np.mean([t.detected for t in found]) <= 0.08


def test_p_values_are_uniform_though_nobody_knows_how_large_the_noise_is() -> None:
    """Every case has noise of another size; with the covariance of one size, half of the noisier ones would be alarms."""
    sizes = np.array([0.6, 1.0, 1.6])
    grid = NoiseGrid(
        [SIZES] * 3, CovarianceFamily(np.eye(N)[None], sizes[:, None] ** 2), np.log(np.full(3, 1.0 / 3.0)), NUMBERS
    )
    rng, p = np.random.default_rng(11), []
    for k in range(200):
        r = sizes[rng.integers(3)] * rng.standard_normal(N)
        p.append(gap_test(grid, r, J, FIELDS, LOOK, seed=k).p_value)
    assert stats.kstest(p, "uniform").pvalue > 0.05
    one = NoiseGrid(grid.sizes[:1], grid.covariances.only(np.array([0])), np.zeros(1), NUMBERS)
    assert gap_test(one, 1.6 * rng.standard_normal(N), J, FIELDS, LOOK).detected


def test_the_most_probable_sizes_of_noise_are_kept() -> None:
    grid = NoiseGrid(
        [replace(SIZES, contour=c) for c in (0.2, 1.0, 5.0)],
        CovarianceFamily(np.eye(N)[None], np.array([[0.04], [1.0], [25.0]])),
        np.log([0.3, 0.3, 0.4]),
        NUMBERS,
    )
    kept = grid.probable(np.random.default_rng(0).standard_normal(N), J, 0.1 * FIELDS, 1)
    assert [s.contour for s in kept.sizes] == [1.0]
    assert kept.log_prior == pytest.approx([0.0])
    assert grid.probable(np.zeros(N), J, FIELDS, 3) is grid


def test_the_gap_test_sees_an_effect_and_not_a_change_of_stiffness() -> None:
    quiet = np.random.default_rng(0).standard_normal(N)
    assert not gap_test(WHITE, quiet + 100.0 * J[:, 0], J, FIELDS, LOOK).detected
    assert gap_test(WHITE, quiet + 3.0 * S[:, 0], J, FIELDS, LOOK).detected
    assert explained(100.0 * J[:, 1], J) < 1e-18


def test_a_mean_of_exponentials_survives_large_exponents() -> None:
    assert mean_of_exponentials(np.array([1000.0, 1000.0 + np.log(3.0)])) == pytest.approx(1000.0 + np.log(2.0))


def judged(effect: str, evidence: float, **changes: object) -> Judged:
    good = Gain(1.0, 0.5, 0.75, 0.2, 0.75)
    values = {"gain": good, "placebo_p": 0.0, "share_of_ceiling": 1.0, "remainder_p": 0.5} | changes
    return Judged(effect, evidence, **values)  # type: ignore[arg-type]


def test_no_gap_is_none_whatever_the_effects_say() -> None:
    assert decide(False, [judged("inclusion", 50.0)], 0.0).verdict == "none"


def test_a_name_that_closes_the_smaller_part_or_means_something_else_does_not_stand_alone() -> None:
    for changes in ({"share_of_ceiling": 0.45}, {"unlike": "it pulls"}):
        found = decide(True, [judged("unmodelled_load", 20.0, **changes), judged("inclusion", 3.0)], 5.0)
        assert (found.verdict, found.candidates) == ("ambiguous", ("unmodelled_load",))
    assert found.why == "it pulls"
    assert decide(True, [judged("unmodelled_load", 20.0, share_of_ceiling=0.55)], 5.0).verdict == "unmodelled_load"


def test_a_load_that_pulls_is_no_push() -> None:
    unlike = library(None)["unmodelled_load"].unlike
    assert unlike({"pressure": 20.0, "shear_1": -30.0, "pressure_2": -5.0}) == ""
    assert "pulls" in unlike({"pressure": 5.0, "shear_1": 30.0, "pressure_2": -20.0})


def test_one_clear_effect_is_named_and_twins_are_not_told_apart() -> None:
    clear = decide(True, [judged("prestress", 20.0), judged("inclusion", 3.0)], 5.0)
    assert (clear.verdict, clear.candidates) == ("prestress", ("prestress",))
    twins = decide(True, [judged("prestress", 20.0), judged("inclusion", 19.5)], 5.0)
    assert (twins.verdict, twins.candidates) == ("ambiguous", ("prestress", "inclusion"))


def test_twins_need_more_than_rivals_that_do_something_else() -> None:
    rivals = [judged("prestress", 20.0), judged("inclusion", 17.8)]
    assert decide(True, rivals, 5.0).verdict == "prestress"
    twins = [rivals[0], judged("inclusion", 17.8, cosine=0.98)]
    assert decide(True, twins, 5.0).candidates == ("prestress", "inclusion")


def test_no_more_probable_name_is_left_out_between_twins() -> None:
    """Odds of 6 are beyond a tie with what is no twin, but a twin at odds of 7 is named, and so is what lies before it."""
    between = [judged("prestress", 20.0), judged("bone_motion", 18.2), judged("inclusion", 18.05, cosine=0.98)]
    assert decide(True, between, 5.0).candidates == ("prestress", "bone_motion", "inclusion")
    behind = [judged("prestress", 20.0), judged("inclusion", 18.2, cosine=0.98), judged("bone_motion", 18.05)]
    assert decide(True, behind, 5.0).candidates == ("prestress", "inclusion")


def test_one_name_needs_four_fifths_of_the_probability() -> None:
    alone = [judged("prestress", 20.0), judged("bone_motion", 18.3)]  # odds of 5.5: beyond a tie
    found = decide(True, alone, 5.0)
    assert found.probability["prestress"] == pytest.approx(0.845, abs=0.005)
    assert found.verdict == "prestress"
    many = [*alone, *(judged(f"rival{k}", 17.5) for k in range(3))]  # 0.70
    found = decide(True, many, 5.0)
    assert (found.verdict, found.candidates) == ("ambiguous", ("prestress", "bone_motion"))


def test_two_effects_together_are_named_where_neither_alone_explains_the_gap() -> None:
    alone = [judged("prestress", 12.0), judged("inclusion", 8.0)]
    both = decide(True, alone, 5.0, (("prestress", "volume_change"), 20.0))
    assert (both.verdict, both.candidates) == ("ambiguous", ("prestress", "volume_change"))
    assert decide(True, alone, 5.0, (("prestress", "volume_change"), 13.0)).verdict == "prestress"


def test_a_refit_counts_where_the_first_look_underrates_an_effect() -> None:
    quiet = np.random.default_rng(0).standard_normal(N)
    assert gap_test(WHITE, quiet, J, FIELDS, LOOK, refitted={"a": 12.0}).detected
    less = gap_test(WHITE, quiet, J, FIELDS, LOOK, refitted={"a": -5.0})
    alone = gap_test(WHITE, quiet, J, FIELDS, LOOK)
    assert less.p_value == min(
        1.0, alone.p_value / (1.0 - RULES.refit_share)
    )  # a refit that fails costs its look alone


def test_false_alarms_keep_their_rate_where_refits_gain_without_a_gap() -> None:
    """Every fourth refit finds 1 more where nothing is."""
    rng, p = np.random.default_rng(3), []
    for k in range(300):
        r = rng.standard_normal(N)
        found = gap_test(WHITE, r, J, FIELDS, LOOK, seed=k, rules=RULES)
        if found.p_value <= RULES.clear:
            refitted = score(r, J, S, SCALES).log_evidence + rng.choice([0.0, 0.0, 0.0, 1.0])
            found = gap_test(WHITE, r, J, FIELDS, LOOK, seed=k, refitted={"a": refitted}, rules=RULES)
        p.append(found.p_value)
    assert stats.kstest(p, "uniform").pvalue > 0.05
    assert np.mean(np.array(p) < 0.05) <= 0.08


def test_a_bayes_factor_is_a_p_value() -> None:
    """Of a gap over none E: noise makes it larger than 1 / p in less than a share p of cases (Markov's inequality)."""
    quiet = np.random.default_rng(0).standard_normal(N)
    first = gap_test(WHITE, quiet, J, FIELDS, LOOK, rules=RULES)
    assert first.p_value > 0.1
    for gain in (5.0, 7.0):
        refitted = gap_test(WHITE, quiet, J, FIELDS, LOOK, refitted={"a": gain}, rules=RULES)
        # The effect has 0.8 of the prior probability of a gap.
        paid = (1.0 - RULES.prior_unknown) * RULES.refit_share
        assert refitted.p_value == pytest.approx(min(1.0, np.exp(-gain) / paid), rel=0.1)


def test_refusals() -> None:
    assert decide(True, [judged("prestress", 20.0, share_of_ceiling=0.85)], 30.0).verdict == "unknown"
    foretells = decide(True, [judged("prestress", 20.0)], 30.0)
    assert (foretells.verdict, foretells.candidates) == ("ambiguous", ("prestress",))
    little = judged("prestress", 20.0, share_of_ceiling=0.3, remainder_p=1e-5)
    assert decide(True, [little], 5.0).verdict == "unknown"
    unconfirmed = judged("prestress", 20.0, gain=Gain(1.0, 1.02, -0.04, 0.05, -0.04))
    assert decide(True, [unconfirmed], 5.0).verdict == "ambiguous"
    no_better_than_chance = judged("prestress", 20.0, placebo_p=0.2)
    assert decide(True, [no_better_than_chance], 5.0).verdict == "ambiguous"


def test_a_name_alone_leaves_noise_or_predicts_as_well_as_a_free_field() -> None:
    left = {"remainder_p": 0.03, "share_of_ceiling": 0.7}
    something_like_it = decide(True, [judged("prestress", 20.0, **left)], 5.0)
    assert (something_like_it.verdict, something_like_it.candidates) == ("ambiguous", ("prestress",))
    for better in ({"remainder_p": 0.06}, {"share_of_ceiling": 0.95}):
        assert decide(True, [judged("prestress", 20.0, **(left | better))], 5.0).verdict == "prestress"


def test_probabilities_add_up_and_follow_the_evidence() -> None:
    found = probabilities({"a": 3.0, "b": 1.0}, 0.0, RULES.prior_unknown)
    assert sum(found.values()) == pytest.approx(1.0)
    assert found["a"] / found["b"] == pytest.approx(np.exp(2.0))
    assert found["unknown"] / found["a"] == pytest.approx(np.exp(-3.0) * 0.2 / 0.4)


def test_the_prior_is_shared_by_the_whole_library_whatever_is_refitted() -> None:
    """Eleven effects that were not refitted keep their share: one refitted effect has no more prior than with all refitted."""
    hopeless = {f"effect{k}": -8.0 for k in range(11)}
    few = decide(True, [judged("prestress", 1.0)], 0.0, first_look=hopeless)
    every = decide(True, [judged("prestress", 1.0), *(judged(k, v) for k, v in hopeless.items())], 0.0)
    assert few.probability == pytest.approx(every.probability)
    assert few.probability["prestress"] / few.probability["unknown"] == pytest.approx(np.exp(1.0) * (0.8 / 12.0) / 0.2)


def test_other_numbers_make_another_gap_test() -> None:
    """A level as strict as the p-value itself; 50 draws, which cannot tell less than one in 51."""
    seen = np.random.default_rng(0).standard_normal(N) + 1.2 * S[:, 0]
    usual = gap_test(WHITE, seen, J, FIELDS, LOOK)
    assert usual.detected
    strict = gap_test(WHITE, seen, J, FIELDS, LOOK, rules=replace(RULES, level=usual.p_value))
    assert not strict.detected and strict.p_value == usual.p_value
    assert gap_test(WHITE, seen, J, FIELDS, LOOK, rules=replace(RULES, gap_draws=50)).p_value >= 1.0 / 51
