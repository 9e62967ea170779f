"""The posterior on a grid against a normal one, closed forms, and draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from palpate.core.arrays import FloatArray
from palpate.core.inference.grid_posterior import on_grid
from palpate.core.inference.posterior import laplace, unknown, verdict
from palpate.core.inference.response_surface import ResponseSurface, chebyshev_nodes

BOUNDS = np.log([[5.0, 500.0], [5.0, 500.0]])


def _surface(residual, slope, box: FloatArray, per_axis: int) -> ResponseSurface:
    nodes = chebyshev_nodes(box, per_axis)
    return ResponseSurface.of(box, nodes, np.stack([residual(x) for x in nodes]), np.stack([slope(x) for x in nodes]))


def test_polynomial_is_met_exactly_and_a_fading_response_closely() -> None:
    box = np.array([[-1.0, 2.0], [0.5, 3.0]])
    x = np.random.default_rng(1).uniform(box[:, 0], box[:, 1], (50, 2))
    cubic = _surface(
        lambda p: np.array([p[0] ** 3 * p[1] + 2.0, p[1] ** 2]),
        lambda p: np.array([[3 * p[0] ** 2 * p[1], p[0] ** 3], [0.0, 2 * p[1]]]),
        box,
        4,
    )
    assert np.allclose(cubic.at(x), np.stack([x[:, 0] ** 3 * x[:, 1] + 2.0, x[:, 1] ** 2], axis=1), atol=1e-10)
    fading = _surface(
        lambda p: np.array([1.0 / (1.0 + np.exp(p[0] - 0.5 * p[1]))]),
        lambda p: (lambda s: np.array([[-s * (1 - s), 0.5 * s * (1 - s)]]))(1.0 / (1.0 + np.exp(p[0] - 0.5 * p[1]))),
        box,
        5,
    )
    true = 1.0 / (1.0 + np.exp(x[:, 0] - 0.5 * x[:, 1]))
    assert np.abs(fading.at(x)[:, 0] - true).max() < 1e-4


def test_each_node_is_next_to_the_one_before() -> None:
    nodes = chebyshev_nodes(np.array([[0.0, 1.0], [0.0, 1.0], [0.0, 1.0]]), 4)
    assert len(np.unique(nodes.round(9), axis=0)) == 64
    assert ((np.abs(np.diff(nodes, axis=0)) > 1e-9).sum(axis=1) == 1).all()


def test_of_a_linear_response_it_is_the_normal_one() -> None:
    J, at = np.array([[4.0, 1.0], [0.5, 6.0], [1.0, -2.0]]), np.log([30.0, 60.0])
    normal = laplace(at, np.zeros(3), J, BOUNDS)
    found = on_grid(normal, _surface(lambda x: J @ (x - at), lambda x: J, BOUNDS, 5))
    assert found is not None
    assert np.allclose(found.sd, np.sqrt(np.diag(np.linalg.inv(J.T @ J))), rtol=0.01)
    assert np.allclose(found.interval(), np.exp(at[:, None] + found.sd[:, None] * norm.ppf([0.025, 0.975])), rtol=0.02)
    assert np.allclose(found.of(slice(1, 2)).quantile(0.9), found.quantile(0.9)[1:])
    assert found.covariance[0, 1] < 0.0  # J'J has a positive product of its columns


def test_a_response_that_fades_with_stiffness_has_a_longer_tail_above() -> None:
    """r = a (exp(-x) - exp(-x0)): the quantiles of x are those of a normal in exp(-x), weighed by the flat prior in x."""
    bounds, x0, a = BOUNDS[:1], np.log(40.0), 200.0
    normal = laplace(np.array([x0]), np.zeros(1), np.array([[-a * np.exp(-x0)]]), bounds)
    found = on_grid(
        normal,
        _surface(
            lambda x: a * (np.exp(-x) - np.exp(-x0)),
            lambda x: np.array([-a * np.exp(-x)]),
            bounds,
            7,
        ),
    )
    assert found is not None
    x = np.linspace(*bounds[0], 20001)
    weight = np.cumsum(np.exp(-0.5 * (a * (np.exp(-x) - np.exp(-x0))) ** 2))
    for p in (0.025, 0.25, 0.5, 0.975):
        assert abs(found.quantile(p)[0] - np.interp(p, weight / weight[-1], x)) < 0.02
    low, high = np.log(found.interval()[0])
    assert high - x0 > 1.5 * (x0 - low)


def test_a_box_that_cuts_the_posterior_is_refused_and_one_that_ends_at_its_bounds_is_not() -> None:
    J, at = np.eye(2), np.log([30.0, 60.0])
    normal = laplace(at, np.zeros(2), J, BOUNDS)
    inside = np.stack([at - 1.0, at + 1.0], axis=1)
    assert on_grid(normal, _surface(lambda x: J @ (x - at), lambda x: J, inside, 4)) is None
    assert on_grid(normal, _surface(lambda x: J @ (x - at), lambda x: J, BOUNDS, 4)) is not None


def test_a_stiffness_at_its_bound_that_the_data_hold_there_is_told() -> None:
    """The spread is that of the posterior itself, not the distance of its mean from the bound."""
    bounds, J = BOUNDS[:1], np.array([[1.5]])
    high = bounds[:, 1]
    normal = laplace(high, np.zeros(1), J, bounds)
    found = on_grid(normal, _surface(lambda x: J @ (x - high), lambda x: J, bounds, 7))
    assert found is not None
    half_normal = np.sqrt(1.0 - 2.0 / np.pi) / 1.5
    assert abs(found.spread[0] - half_normal) < 0.01 and abs(found.sd[0] - 1.0 / 1.5) < 0.01
    assert not unknown(found).any()
    # Two thirds of a half normal lie within one of its standard deviations, all on one side.
    G = float(np.exp(high[0]))
    assert found.sd_kpa()[0] == pytest.approx(G - G * np.exp(-1.0 / 1.5), rel=0.02)
    flat = on_grid(laplace(high, np.zeros(1), 0 * J, bounds), _surface(lambda x: 0 * x, lambda x: 0 * J, bounds, 7))
    assert flat is not None and unknown(flat).all()


def test_too_small_a_deformation_is_not_said_where_the_misfit_is_far_above_the_noise() -> None:
    blind = laplace(BOUNDS.mean(axis=1), np.zeros(9), np.zeros((9, 2)), BOUNDS)
    assert "too small" in verdict(("left", "right"), blind)
    missed = laplace(BOUNDS.mean(axis=1), np.full(9, 5.0), np.zeros((9, 2)), BOUNDS)
    assert "too small" not in verdict(("left", "right"), missed) and "misses" in verdict(("left", "right"), missed)
