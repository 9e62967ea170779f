"""The posterior around a fit, of models whose residual is known: what is solved, and what is said where little can be."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.inference.grid_posterior import GridPosterior
from palpate.core.residual.exploration import Whitened, explored, posterior_of

BOUNDS = np.log([[5.0, 500.0], [5.0, 500.0]])
AT = np.log([30.0, 60.0])
J = np.array([[8.0, 1.0], [0.5, 9.0], [1.0, -2.0]])
LEFT = 0.2 * np.linalg.svd(J)[0][:, 2]  # no change of the stiffness explains any of it


def residual(theta: FloatArray, strong: float) -> tuple[FloatArray, FloatArray]:
    return LEFT + strong * J @ (theta - AT), strong * J


class Model:
    """solved : where it was asked for, each with where it was started from. lacking : theta without an equilibrium."""

    def __init__(self, strong: float, lacking: Any = lambda theta: False) -> None:
        self.strong, self.lacking = strong, lacking
        self.solved: list[tuple[FloatArray, FloatArray]] = []

    def __call__(self, theta: FloatArray, near: Any) -> Whitened | None:
        self.solved.append((theta, near.theta))
        return None if self.lacking(theta) else self.at(theta)

    def at(self, theta: FloatArray) -> Whitened:
        there: Any = SimpleNamespace(theta=theta)
        return Whitened(there, *residual(theta, self.strong))


def test_of_a_linear_model_it_is_the_normal_one_found_within_five_standard_deviations() -> None:
    model = Model(1.0)
    found = explored(model, model.at(AT), BOUNDS)
    assert isinstance(found, GridPosterior)
    exact = np.sqrt(np.diag(np.linalg.inv(J.T @ J)))
    assert found.sd == pytest.approx(exact, rel=0.03)
    assert len(model.solved) == 16
    reach = np.abs([theta - AT for theta, _ in model.solved]).max(axis=0)
    assert reach == pytest.approx(5.0 * exact, rel=0.02)


def test_a_posterior_that_is_wider_than_it_looks_is_looked_at_within_its_bounds() -> None:
    """The response fades with the stiffness: what is five standard deviations off still has a high density."""
    model = Model(0.0)

    def fading(theta: FloatArray) -> Whitened:
        y = theta - AT
        there: Any = SimpleNamespace(theta=theta)
        return Whitened(there, 6.0 * np.tanh(y) / 3.0, np.diag(2.0 / np.cosh(y) ** 2))

    model.at = fading  # type: ignore[method-assign]
    found = explored(model, model.at(AT), BOUNDS)
    assert isinstance(found, GridPosterior)
    ends = np.array([theta for theta, _ in model.solved])
    assert ends.min(axis=0) == pytest.approx(BOUNDS[:, 0]) and ends.max(axis=0) == pytest.approx(BOUNDS[:, 1])
    below, above = np.log(found.interval()[0]) - AT[0]
    assert above > -1.2 * below


def test_each_point_is_started_from_the_last_one_that_has_an_equilibrium() -> None:
    model = Model(1.0, lambda theta: theta[0] < AT[0] - 0.3)
    explored(model, model.at(AT), BOUNDS)
    before = AT
    for k, (theta, near) in enumerate(model.solved):
        before = before if k % 16 else AT  # each box is begun from the fit
        np.testing.assert_array_equal(near, before)
        if not model.lacking(theta):
            before = theta


@pytest.mark.parametrize(("lacking", "grid"), [(3, True), (4, False)])
def test_where_more_than_a_fifth_of_the_points_has_no_equilibrium_it_is_the_normal_one(
    lacking: int, grid: bool
) -> None:
    """Of 16 points 13 suffice: a surface through fewer would be made up."""
    model = Model(1.0)
    model.lacking = lambda theta: len(model.solved) % 16 in range(1, lacking + 1)
    found = explored(model, model.at(AT), BOUNDS)
    assert isinstance(found, GridPosterior) == grid
    if not grid:
        assert found.covariance == pytest.approx(np.linalg.inv(J.T @ J + np.diag(12.0 / np.ptp(BOUNDS, axis=1) ** 2)))


def test_more_than_three_parameters_have_the_normal_one_and_one_has_seven_points() -> None:
    many = np.tile(BOUNDS[:1], (4, 1))
    here: Any = SimpleNamespace(theta=np.full(4, AT[0]))
    model = Model(1.0)
    assert not isinstance(explored(model, Whitened(here, np.zeros(4), 8.0 * np.eye(4)), many), GridPosterior)
    assert model.solved == []

    asked: list[FloatArray] = []

    def one(theta: FloatArray, near: Any) -> Whitened:
        asked.append(theta)
        there: Any = SimpleNamespace(theta=theta)
        return Whitened(there, 8.0 * (theta - AT[:1]), 8.0 * np.eye(1))

    found = explored(one, one(AT[:1], None), BOUNDS[:1])
    assert len(asked) == 8 and found.sd == pytest.approx([0.125], rel=0.02)


def test_the_plain_model_is_weighed_by_its_noise() -> None:
    weights: Any = SimpleNamespace(whiten=lambda x: 4.0 * x)

    def plain(theta: FloatArray, near: Any) -> Any:
        r, slope = residual(theta, 1.0)
        return SimpleNamespace(theta=theta, residual=r, in_theta=slope)

    model: Any = SimpleNamespace(plain=plain)
    found = posterior_of(model, weights, plain(AT, None), BOUNDS)
    assert found.sd == pytest.approx(0.25 * np.sqrt(np.diag(np.linalg.inv(J.T @ J))), rel=0.05)
    nowhere: Any = SimpleNamespace(plain=lambda theta, near: None)
    assert not isinstance(posterior_of(nowhere, weights, plain(AT, None), BOUNDS), GridPosterior)
