"""The stiffness with an effect on a grid, against closed forms and against integration over stiffness and effect together."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.diagnose.refit.stiffness_posterior import with_posterior

SCALES = np.array([2.0, 0.5])
WIDE = np.array([[-4.0, 8.0], [-5.0, 7.0]])


def _fitted(
    residual: Callable[[FloatArray], FloatArray],
    gradient: Callable[[FloatArray], FloatArray],
    in_phi: FloatArray,
    theta: FloatArray,
    phi: FloatArray,
    bounds: FloatArray,
) -> tuple[Any, Any]:
    """A fit and a refit of a model whose weighted residual is residual(theta) + in_phi phi."""

    def at(theta: FloatArray, phi: FloatArray) -> SimpleNamespace:
        return SimpleNamespace(theta=theta, phi=phi, residual=residual(theta) + in_phi @ phi, in_theta=gradient(theta))

    model = SimpleNamespace(
        solve=lambda hypothesis, theta, phi, near: at(theta, phi), directions=lambda hypothesis, there: in_phi
    )
    model.corrected = lambda correction: model
    fit = SimpleNamespace(model=model, weighting=SimpleNamespace(whiten=lambda a: a), bounds=bounds)
    effect = SimpleNamespace(id="bone_motion", scales=SCALES, bounds=np.tile([-np.inf, np.inf], (2, 1)))
    return fit, RefitLike(SimpleNamespace(effect=effect), at(theta, phi), in_phi)


class RefitLike(SimpleNamespace):
    """What `with_posterior` reads of a refit, which `dataclasses.replace` cannot copy."""

    def __init__(self, hypothesis: Any, linearisation: Any, in_phi: FloatArray) -> None:
        super().__init__(
            hypothesis=hypothesis, linearisation=linearisation, in_phi=in_phi, phi=linearisation.phi, correction=None
        )


@pytest.fixture(autouse=True)
def _copied(monkeypatch: pytest.MonkeyPatch) -> None:
    def replaced(refit: RefitLike, **changes: object) -> SimpleNamespace:
        return SimpleNamespace(**(vars(refit) | changes))

    monkeypatch.setattr("palpate.core.diagnose.refit.stiffness_posterior.replace", replaced)


def test_of_a_linear_model_it_is_the_marginal_of_stiffness_and_effect_together() -> None:
    rng = np.random.default_rng(1)
    A, S, truth = rng.normal(size=(30, 2)) * 2.0, rng.normal(size=(30, 2)), np.array([1.0, 1.5])
    joint = np.block([[A.T @ A, A.T @ S], [S.T @ A, S.T @ S + np.diag(1.0 / SCALES**2)]])
    fit, refit = _fitted(lambda t: A @ (t - truth), lambda t: A, S, truth, np.zeros(2), WIDE)
    found = with_posterior(fit, refit).posterior
    assert found is not None
    np.testing.assert_allclose(found.mean, truth)
    np.testing.assert_allclose(found.covariance, np.linalg.inv(joint)[:2, :2], rtol=0.02)


def test_without_a_grid_the_refit_stays_as_it_is() -> None:
    """A model that has no equilibrium anywhere else."""
    rng = np.random.default_rng(4)
    A, S = rng.normal(size=(30, 2)), rng.normal(size=(30, 2))
    fit, refit = _fitted(lambda t: A @ t, lambda t: A, S, np.zeros(2), np.zeros(2), WIDE)
    fit.model.solve = lambda hypothesis, theta, phi, near: None
    assert with_posterior(fit, refit) is refit


def test_a_parameter_at_its_bound_takes_nothing_up() -> None:
    rng = np.random.default_rng(2)
    A, S = rng.normal(size=(30, 2)) * 2.0, rng.normal(size=(30, 2))
    fit, refit = _fitted(lambda t: A @ t, lambda t: A, S, np.zeros(2), np.zeros(2), WIDE)
    refit.hypothesis.effect.bounds = np.array([[0.0, np.inf], [-np.inf, np.inf]])
    free = np.block([[A.T @ A, A.T @ S[:, 1:]], [S[:, 1:].T @ A, S[:, 1:].T @ S[:, 1:] + 1.0 / SCALES[1] ** 2]])
    found = with_posterior(fit, refit).posterior
    assert found is not None
    np.testing.assert_allclose(found.covariance, np.linalg.inv(free)[:2, :2], rtol=0.02)


def test_a_response_that_fades_leaves_stiffer_organs_less_excluded() -> None:
    """Integrated over stiffness and effect together, on a fine grid of both."""
    rng = np.random.default_rng(3)
    one, S = rng.normal(size=25), rng.normal(size=(25, 2))
    bounds = np.log([[5.0, 500.0]])
    response = lambda t: 60.0 / (20.0 + np.exp(t[..., :1])) * one  # noqa: E731
    slope = lambda t: (-60.0 * np.exp(t) / (20.0 + np.exp(t)) ** 2)[:, None].T * one[:, None]  # noqa: E731
    best = np.log([40.0])
    data = response(best)
    fit, refit = _fitted(lambda t: response(t) - data, slope, S, best, np.zeros(2), bounds)
    found = with_posterior(fit, refit).posterior
    assert found is not None
    grid = np.linspace(*bounds[0], 4001)
    A = np.vstack([S, np.diag(1.0 / SCALES)])
    Q = np.linalg.qr(A)[0]
    r = np.vstack([(response(grid[:, None]) - data).T, np.zeros((2, len(grid)))])
    weight = np.exp(-0.5 * ((r - Q @ (Q.T @ r)) ** 2).sum(axis=0))
    below = np.cumsum(weight) / weight.sum()
    expected = [np.interp(p, below, grid) for p in (0.025, 0.5, 0.975)]
    np.testing.assert_allclose([found.quantile(p)[0] for p in (0.025, 0.5, 0.975)], expected, atol=0.02)
    assert expected[2] - best[0] > 1.3 * (best[0] - expected[0])
