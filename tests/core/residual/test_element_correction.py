"""The better element's correction: with it, the quick element's residual changes with ln G as the better one's does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from synthetic_case import problem

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.effects import library
from palpate.core.forward.effect import Surroundings
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.element_error import element_errors, fine_element_model, fine_element_residual
from palpate.core.residual.fit_options import GOOD, FitOptions
from palpate.core.residual.linearised_model import NOTHING, PLAIN, Hypothesis, Linearisation, StateModel
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.state_models import joint_model

THETA = np.log([30.0, 70.0])
STEP = 0.05


@pytest.fixture(scope="module")
def model() -> StateModel:
    return joint_model([(problem(depth=5.0), None)], NoiseModelOptions(), WallMotionOptions(), FitOptions()).first


@pytest.fixture(scope="module")
def here(model: StateModel) -> Linearisation:
    return solved(model, THETA, None)


def solved(model: StateModel, theta: FloatArray, near: Linearisation | None) -> Linearisation:
    found = model.solve(PLAIN, theta, NOTHING, near)
    assert found is not None
    return found


def test_the_corrected_residual_changes_as_the_better_elements(model: StateModel, here: Linearisation) -> None:
    correction = element_errors(model, here, (), GOOD).correction
    corrected, fine = replace(model, correction=correction), fine_element_model(model)
    for k in range(2):
        step = STEP * np.eye(2)[k]
        ends = [solved(corrected, THETA + s, here) for s in (step, -step)]
        better = [fine_element_residual(fine, PLAIN, end) for end in ends]
        assert better[0] is not None and better[1] is not None
        change = (better[0] - better[1]) / (2.0 * STEP)
        told = (ends[0].residual - ends[1].residual) / (2.0 * STEP)
        slope = solved(corrected, THETA, here).in_theta[:, k]
        without = np.linalg.norm(here.in_theta[:, k] - change)
        assert np.linalg.norm(told - change) < 0.3 * without
        assert np.linalg.norm(slope - change) < 0.3 * without
        assert without > 0.05 * np.linalg.norm(change)


def test_derivative_and_ends_of_a_correction() -> None:
    rng = np.random.default_rng(5)
    one = ElementCorrection(np.array([1.0, 2.0]), rng.normal(size=4), rng.normal(size=(4, 2)))
    np.testing.assert_array_equal(one.at(one.theta), one.value)
    np.testing.assert_array_equal(one.in_theta(one.theta), one.slope)
    theta, h = np.array([1.7, 0.9]), 1e-6
    for k in range(2):
        step = h * np.eye(2)[k]
        np.testing.assert_allclose(
            (one.at(theta + step) - one.at(theta - step)) / (2 * h), one.in_theta(theta)[:, k], atol=1e-8
        )
    far = one.at(one.theta + 50.0)
    np.testing.assert_allclose(far, one.value + one.slope.sum(axis=1))


def test_corrections_of_states_are_stacked_and_taken_apart() -> None:
    theta = np.array([3.0])
    each = [ElementCorrection(theta, np.full(n, float(n)), np.full((n, 1), 0.5 * n)) for n in (2, 3)]
    both = ElementCorrection.stacked(each)
    assert both.at(theta + 0.1).shape == (5,)
    np.testing.assert_array_equal(both.of(slice(2, 5)).at(theta + 0.1), each[1].at(theta + 0.1))
    nothing = ElementCorrection.none(3)
    assert not nothing.at(theta).any() and nothing.in_theta(theta).shape == (3, 1)


def test_what_an_effect_changes_does_not_hang_on_the_correction(model: StateModel, here: Linearisation) -> None:
    """The better element's correction is the same with the effect and without it."""
    effect = library()["volume_change"]
    hypothesis = Hypothesis(effect, effect.variants(Surroundings(model.plain.problem))[0])
    rng, n = np.random.default_rng(3), model.data.n
    correction = ElementCorrection(THETA - 0.2, rng.normal(size=n), rng.normal(size=(n, 2)))
    corrected = replace(model, correction=correction)
    at = replace(here, phi=np.zeros(hypothesis.n))
    with_it = replace(solved(corrected, THETA, here), phi=np.zeros(hypothesis.n))
    assert with_it.residual == pytest.approx(here.residual + correction.at(THETA), abs=1e-3)
    plain = model.directions(hypothesis, at)
    assert np.linalg.norm(plain) > 0.1
    np.testing.assert_allclose(corrected.directions(hypothesis, with_it), plain, atol=1e-3 * np.abs(plain).max())


def test_what_the_better_element_changes_is_counted_from_the_quick_one_without_its_correction(
    model: StateModel, here: Linearisation
) -> None:
    found = element_errors(model, here, (), GOOD)
    better = fine_element_residual(fine_element_model(model), PLAIN, here)
    assert better is not None
    np.testing.assert_allclose(found.every, [better - here.residual], atol=1e-9)
    correction = replace(found.correction, value=found.correction.value + 1.0)
    again = element_errors(
        replace(model, correction=correction), solved(replace(model, correction=correction), THETA, here), (), GOOD
    )
    np.testing.assert_allclose(again.every, found.every, atol=1e-4)
