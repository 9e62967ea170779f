"""The stiffness over several possible causes."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.effects import Parameter
from palpate.core.diagnose.verdict import model_average as averaging
from palpate.core.diagnose.verdict.model_average import _twin, _unnamed, mixture, model_average, over_variants

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


def _variant(
    theta: FloatArray,
    covariance: FloatArray,
    evidence: float,
    bounds_kpa: tuple[float, float],
    others: tuple[SimpleNamespace, ...] = (),
    beyond: float = 0.0,
) -> SimpleNamespace:
    """A refit; beyond : of its first ln G."""
    bounds = np.tile(np.log(bounds_kpa), (len(theta), 1))
    scene = SimpleNamespace(parameters=SimpleNamespace(bounds=bounds))
    point = SimpleNamespace(theta=theta, first=SimpleNamespace(scene=scene))
    out = np.zeros(len(theta))
    out[0] = beyond
    return SimpleNamespace(
        linearisation=point,
        covariance=covariance,
        own_evidence=evidence,
        others=others,
        beyond=out,
        posterior=None,
        hypothesis=SimpleNamespace(effect=None),
    )


def test_a_posterior_on_a_grid_takes_the_place_of_the_normal() -> None:
    """Its optimum and the mean square about it; the weight of the variant stays."""
    wide, rival = (_variant(np.log([40.0]), np.array([[0.01]]), 9.0, (5.0, 500.0)) for _ in range(2))
    wide.posterior = SimpleNamespace(mean=np.log([40.0]), covariance=np.array([[0.25]]))
    mean, covariance = over_variants(wide)
    assert (np.exp(mean[0]), covariance[0, 0]) == (pytest.approx(40.0), 0.25)
    wide.others = (rival,)
    assert over_variants(wide)[1][0, 0] == pytest.approx(0.5 * (0.25 + 0.01))


def test_variants_that_fit_as_well_and_mean_another_stiffness_widen_its_interval() -> None:
    """Tissue twelve times stiffer behind, or softer before: one in two, a factor of twelve apart."""

    def variant(G: float, evidence: float, *others: SimpleNamespace) -> SimpleNamespace:
        return _variant(np.log([G, 2.0 * G]), np.diag([0.04, 0.04, 1.0]), evidence, (0.05, 5000.0), others)

    mean, covariance = over_variants(variant(5.0, 9.0, variant(60.0, 9.0)))  # type: ignore[arg-type]
    np.testing.assert_allclose(np.exp(mean), np.sqrt(300.0) * np.array([1.0, 2.0]))
    assert covariance[0, 0] == pytest.approx(0.04 + (0.5 * np.log(12.0)) ** 2)
    rather = over_variants(variant(5.0, 9.0, variant(60.0, 7.0)))[0]  # type: ignore[arg-type]
    share = 1.0 / (1.0 + np.exp(-2.0))
    assert rather[0] == pytest.approx(share * np.log(5.0) + (1.0 - share) * np.log(60.0))
    alone = over_variants(variant(5.0, 9.0, variant(60.0, -20.0)))  # type: ignore[arg-type]
    assert np.exp(alone[0][0]) == pytest.approx(5.0)


def test_a_contrast_over_the_tissue_has_a_twin_in_which_the_other_part_is_the_reference() -> None:
    """ln G and contrast of one fit, and the same with ln G less the contrast: as likely where both are allowed."""
    covariance = np.array([[0.05, 0.02, 0.03], [0.02, 0.06, 0.03], [0.03, 0.03, 0.07]])
    found = _variant(np.log([300.0, 150.0]), covariance, 9.0, (0.05, 5000.0))
    contrast, plane = Parameter("log_contrast", "1", 1.5, over_reference=True), Parameter("shift", "mm", 6.0)
    found.phi = np.array([np.log(6.0)])
    found.hypothesis.effect = SimpleNamespace(parameters=(contrast,))
    mean, spread = over_variants(found)
    np.testing.assert_allclose(np.exp(mean), [300.0 / np.sqrt(6.0), 150.0 / np.sqrt(6.0)])
    twin = 0.05 + 0.07 - 2.0 * 0.03
    assert spread[0, 0] == pytest.approx(0.5 * (0.05 + twin) + (0.5 * np.log(6.0)) ** 2)
    # Where only one of the two is allowed, it is the answer.
    found.linearisation.first.scene.parameters.bounds = np.log([[100.0, 5000.0]] * 2)
    assert np.exp(over_variants(found)[0][0]) > 250.0
    found.hypothesis.effect = SimpleNamespace(parameters=(plane,))
    np.testing.assert_allclose(np.exp(over_variants(found)[0]), [300.0, 150.0], rtol=0.05)


@pytest.mark.parametrize("beyond", [0.0, -0.4, -1.5])
def test_a_variant_held_at_a_bound_counts_with_what_lies_within(beyond: float) -> None:
    """Two variants whose likelihoods are normal in ln G; what both say together, integrated over the ln G that are allowed."""
    bounds, sd = (5.0, 500.0), 0.5
    peaks = (float(np.log(5.0)) + beyond, float(np.log(60.0)))
    held = [max(peak, float(np.log(5.0))) for peak in peaks]
    # Both have the same likelihood where they were fitted; Laplace's integral is over all ln G.
    rival = _variant(np.array(held[1:]), np.array([[sd**2]]), 3.0, bounds)
    found = _variant(np.array(held[:1]), np.array([[sd**2]]), 3.0, bounds, (rival,), beyond)
    mean, covariance = over_variants(found)  # type: ignore[arg-type]
    theta = np.linspace(*np.log(bounds), 200_001)
    density = sum(
        np.exp(0.5 * (at - peak) ** 2 / sd**2 - 0.5 * (theta - peak) ** 2 / sd**2)
        for at, peak in zip(held, peaks, strict=True)
    )
    density /= density.sum()
    exact = float(density @ theta)
    assert mean[0] == pytest.approx(exact, abs=1e-4)
    assert covariance[0, 0] == pytest.approx(float(density @ (theta - exact) ** 2), rel=1e-3)


def test_the_twin_of_a_variant_held_at_a_bound_lies_beyond_it_as_well() -> None:
    """ln G where the fit would be without its bound, less the contrast."""
    found = _variant(np.log([500.0]), np.array([[0.01, 0.0], [0.0, 0.01]]), 9.0, (0.05, 500.0), (), 0.4)
    contrast = Parameter("log_contrast", "1", 1.5, over_reference=True)
    found.phi, found.hypothesis.effect = np.array([np.log(6.0)]), SimpleNamespace(parameters=(contrast,))
    of, _ = _twin(found)  # type: ignore[arg-type]
    assert of.mean == pytest.approx(np.log([500.0 / 6.0]) + 0.4, abs=1e-3)


def test_something_unnamed_has_the_stiffness_that_a_free_field_leaves_it() -> None:
    """To first order: least squares of data, prior and field together, held between the bounds."""
    rng = np.random.default_rng(2)
    J, F, r = rng.standard_normal((9, 2)), rng.standard_normal((9, 3)), 0.3 * rng.standard_normal(9)
    bounds, theta = np.tile(np.log([5.0, 500.0]), (2, 1)), np.log([20.0, 60.0])
    linearisation = SimpleNamespace(theta=theta, residual=r, in_theta=J)
    weighting = SimpleNamespace(whiten=lambda x: 2.0 * x)
    fit = SimpleNamespace(linearisation=linearisation, bounds=bounds, weighting=weighting)
    diagnosis = SimpleNamespace(fit=fit, forces=SimpleNamespace(free=F))
    X = np.hstack([J, F])
    H = 4.0 * X.T @ X + np.diag([*(12.0 / np.ptp(bounds, axis=1) ** 2), 1.0, 1.0, 1.0])
    mean, covariance = _unnamed(diagnosis)  # type: ignore[arg-type]
    assert mean == pytest.approx(theta - np.linalg.solve(H, 4.0 * X.T @ r)[:2])
    assert covariance == pytest.approx(np.linalg.inv(H)[:2, :2])
    linearisation.residual = r - 100.0 * J[:, 0]
    assert _unnamed(diagnosis)[0][0] == pytest.approx(np.log(500.0))  # type: ignore[arg-type]


def test_two_effects_together_count_by_their_probability() -> None:
    """Alone the best effect says 40 kPa; with a second one it is 10 kPa."""

    def fitted(G: float, name: str) -> SimpleNamespace:
        one = _variant(np.log([G]), np.array([[0.01]]), 0.0, (5.0, 500.0))
        one.hypothesis = SimpleNamespace(effect=SimpleNamespace(id=name, parameters=()))
        return one

    verdict = SimpleNamespace(probability={"bone_motion": 0.25, "bone_motion+prestress": 0.75, "unknown": 0.0})
    diagnosis = SimpleNamespace(
        fit=SimpleNamespace(bounds=np.log([[5.0, 500.0]])),
        verdict=verdict,
        refits=[fitted(40.0, "bone_motion")],
        pairs=[fitted(10.0, "bone_motion+prestress")],
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(averaging, "_unnamed", lambda _: (np.log([30.0]), np.array([[1.0]])))
        mean, covariance = model_average(diagnosis)  # type: ignore[arg-type]
    assert mean[0] == pytest.approx(0.25 * np.log(40.0) + 0.75 * np.log(10.0))
    assert covariance[0, 0] == pytest.approx(0.01 + 0.25 * 0.75 * np.log(4.0) ** 2)
