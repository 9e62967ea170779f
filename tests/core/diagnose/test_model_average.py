"""The stiffness over several possible causes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from palpate.core.diagnose.verdict.model_average import mixture, over_variants

MODELS = {
    "volume_change": (np.array([3.0, 4.0]), np.diag([0.04, 0.09])),
    "contour_bias": (np.array([3.6, 3.9]), np.array([[0.01, 0.005], [0.005, 0.02]])),
    "unknown": (np.array([2.0, 4.5]), np.diag([0.5, 0.5])),
}
PROBABILITY = {"volume_change": 0.45, "contour_bias": 0.3, "unknown": 0.15, "prestress": 0.1}


def test_a_mixture_has_the_moments_of_its_samples() -> None:
    rng = np.random.default_rng(4)
    weight = np.array([PROBABILITY[name] for name in MODELS])
    which = rng.choice(len(MODELS), size=200_000, p=weight / weight.sum())
    draws = np.stack([rng.multivariate_normal(*MODELS[name], size=len(which)) for name in MODELS])
    drawn = draws[which, np.arange(len(which))]
    mean, covariance = mixture(MODELS, PROBABILITY)
    np.testing.assert_allclose(mean, drawn.mean(axis=0), atol=0.01)
    np.testing.assert_allclose(covariance, np.cov(drawn.T), atol=0.02)


def test_one_sure_cause_is_its_own_answer_and_rivals_that_differ_widen_it() -> None:
    mean, covariance = mixture(MODELS, {"contour_bias": 1.0})
    np.testing.assert_allclose(mean, MODELS["contour_bias"][0])
    np.testing.assert_allclose(covariance, MODELS["contour_bias"][1])
    both = mixture(MODELS, {"contour_bias": 0.5, "volume_change": 0.5})[1]
    assert both[0, 0] == pytest.approx(0.5 * (0.04 + 0.01) + 0.3**2)


def test_variants_that_fit_as_well_and_mean_another_stiffness_widen_its_interval() -> None:
    """Tissue twelve times stiffer behind, or softer before: one in two, a factor of twelve apart."""

    def variant(G: float, evidence: float, *others: SimpleNamespace) -> SimpleNamespace:
        point = SimpleNamespace(theta=np.log([G, 2.0 * G]))
        return SimpleNamespace(
            linearisation=point, covariance=np.diag([0.04, 0.04, 1.0]), own_evidence=evidence, others=others
        )

    mean, covariance = over_variants(variant(5.0, 9.0, variant(60.0, 9.0)))  # type: ignore[arg-type]
    np.testing.assert_allclose(np.exp(mean), np.sqrt(300.0) * np.array([1.0, 2.0]))
    assert covariance[0, 0] == pytest.approx(0.04 + (0.5 * np.log(12.0)) ** 2)
    rather = over_variants(variant(5.0, 9.0, variant(60.0, 7.0)))[0]  # type: ignore[arg-type]
    share = 1.0 / (1.0 + np.exp(-2.0))
    assert rather[0] == pytest.approx(share * np.log(5.0) + (1.0 - share) * np.log(60.0))
    alone = over_variants(variant(5.0, 9.0, variant(60.0, -20.0)))  # type: ignore[arg-type]
    assert np.exp(alone[0][0]) == pytest.approx(5.0)
