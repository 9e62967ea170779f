"""Start points and the search from one of them, on arrays."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.inference.evidence import score
from palpate.core.inference.gauss_newton import Linearise, gauss_newton
from palpate.core.inference.starts import middle, spread_starts

WIDE = np.array([[-100.0, 100.0], [-100.0, 100.0]])
J = np.array([[2.0, 0.5], [0.3, 1.5], [-0.7, 1.0]])
R = np.array([1.0, -2.0, 0.5])


def linear(asked: list[FloatArray] | None = None) -> Linearise:
    def at(theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        if asked is not None:
            asked.append(theta)
        return R + J @ theta, J

    return at


def test_starts_are_the_middle_and_the_r_sequence() -> None:
    """Of one axis its steps are the golden ratio's inverse; of two those of the plastic number, 1.3247."""
    bounds = np.array([[1.0, 5.0]])
    assert middle(bounds) == pytest.approx([2.6])
    found = spread_starts(bounds, 4)[:, 0]
    golden = 0.5 * (np.sqrt(5.0) - 1.0)
    share = (0.5 + golden * np.arange(1, 4)) % 1.0
    assert found == pytest.approx([2.6, *(1.0 + 4.0 * (0.15 + 0.7 * share))])
    two = spread_starts(np.array([[0.0, 1.0], [0.0, 1.0]]), 2)[1]
    plastic = 1.324717957244746
    assert two == pytest.approx(0.15 + 0.7 * ((0.5 + np.array([1.0 / plastic, plastic**-2])) % 1.0))


def test_the_minimum_of_a_linear_residual_is_found_whatever_the_start() -> None:
    exact = -np.linalg.solve(J.T @ J, J.T @ R)
    for start in (np.zeros(2), np.array([3.0, -2.0])):
        found = gauss_newton(linear(), start, WIDE, tolerance=1e-8)
        assert found is not None and found.converged
        assert found.theta == pytest.approx(exact, abs=1e-6)
        assert found.misfit == pytest.approx(float(np.sum((R + J @ exact) ** 2)))
        assert found.misfit == pytest.approx(found.history[-1])
        assert all(b < a for a, b in zip(found.history, found.history[1:], strict=False))


def test_a_step_is_no_longer_than_its_limit_and_every_evaluation_counts() -> None:
    asked: list[FloatArray] = []
    found = gauss_newton(linear(asked), np.array([30.0, 30.0]), WIDE)
    assert found is not None and found.evaluations == len(asked)
    assert np.abs(np.diff(asked, axis=0)).max() <= 1.2 + 1e-12
    assert np.abs(asked[1] - asked[0]).max() == pytest.approx(1.2)
    stopped = gauss_newton(linear(), np.array([30.0, 30.0]), WIDE, max_evaluations=5)
    assert stopped is not None and (stopped.evaluations, stopped.converged) == (5, False)


def test_a_parameter_that_presses_against_a_bound_is_held_and_the_other_is_solved_alone() -> None:
    free = -np.linalg.solve(J.T @ J, J.T @ R)
    bounds = np.array([[free[0] + 0.5, 100.0], [-100.0, 100.0]])
    found = gauss_newton(linear(), np.array([free[0] + 2.0, 0.0]), bounds, tolerance=1e-8)
    assert found is not None and found.converged
    assert found.theta[0] == pytest.approx(free[0] + 0.5)
    left = R + J[:, 0] * found.theta[0]
    assert found.theta[1] == pytest.approx(-(J[:, 1] @ left) / (J[:, 1] @ J[:, 1]), abs=1e-6)
    above = np.array([[-100.0, free[0] - 0.5], [-100.0, 100.0]])
    other = gauss_newton(linear(), np.array([free[0] - 2.0, 0.0]), above, tolerance=1e-8)
    assert other is not None and other.theta[0] == pytest.approx(free[0] - 0.5)


@pytest.mark.parametrize("side", [0, 1])
def test_a_parameter_at_a_bound_that_wants_inwards_is_free(side: int) -> None:
    free = -np.linalg.solve(J.T @ J, J.T @ R)
    bounds = np.tile([-100.0, 100.0], (2, 1))
    bounds[0, side] = free[0] + (-0.4, 0.4)[side]
    found = gauss_newton(linear(), np.array([bounds[0, side], free[1]]), bounds, tolerance=1e-8)
    assert found is not None and found.theta == pytest.approx(free, abs=1e-6)


def test_a_start_beyond_the_bounds_is_brought_in_and_one_without_an_answer_is_none() -> None:
    asked: list[FloatArray] = []
    gauss_newton(linear(asked), np.array([1e3, -1e3]), WIDE)
    assert asked[0].tolist() == [100.0, -100.0]
    assert gauss_newton(lambda theta: None, np.zeros(2), WIDE) is None


def test_a_step_that_does_not_help_or_has_no_answer_is_made_shorter() -> None:
    """r = arctan(10 theta): a full step from far out overshoots; beyond 1.5 there is no answer."""
    asked: list[float] = []

    def bent(theta: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        asked.append(float(theta[0]))
        if abs(theta[0]) > 1.5:
            return None
        return np.arctan(10.0 * theta), (10.0 / (1.0 + 100.0 * theta**2))[:, None]

    found = gauss_newton(bent, np.array([1.0]), np.array([[-5.0, 5.0]]), tolerance=1e-9, max_evaluations=60)
    assert found is not None and found.converged
    assert found.theta == pytest.approx([0.0], abs=1e-6)
    assert len(asked) > len(found.history)  # some were turned down


def test_where_no_step_helps_the_search_ends() -> None:
    """A derivative with the wrong sign: every step makes it worse, until steps are too short to count or the damping is spent."""
    found = gauss_newton(lambda theta: (theta, -np.eye(1)), np.array([1.0]), np.array([[-5.0, 5.0]]), tolerance=0.0)
    assert found is not None and found.theta.tolist() == [1.0]
    assert found.evaluations < 25 and found.converged


def test_a_score_is_chi_squared_with_as_many_degrees_as_it_has_columns() -> None:
    rng = np.random.default_rng(5)
    S = rng.standard_normal((400, 3))
    p = np.array([
        [score(r, np.zeros((400, 1)), S[:, :k], np.ones(k)).p_value for k in (1, 3)]
        for r in rng.standard_normal((800, 400))
    ])  # fmt: skip
    for column in p.T:
        assert np.abs(np.sort(column) - (np.arange(800) + 0.5) / 800).max() < 0.06
    twice = np.column_stack([S[:, 0], S[:, 0]])
    r = rng.standard_normal(400)
    assert score(r, np.zeros((400, 1)), twice, np.ones(2)).p_value == pytest.approx(
        score(r, np.zeros((400, 1)), S[:, :1], np.ones(1)).p_value
    )
