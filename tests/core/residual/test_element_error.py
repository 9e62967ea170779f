"""What the better element changes, on arrays: over meshes, and where it has an equilibrium."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.core.residual import element_error
from palpate.core.residual.element_correction import ElementCorrection
from palpate.core.residual.element_error import ElementErrors, element_errors, scatter_mm
from palpate.core.residual.fit_options import GOOD, QUICK
from palpate.core.residual.linearised_model import PLAIN

N, T = 5, 2
RNG = np.random.default_rng(6)
THETA = np.log([20.0, 60.0])
QUICK_RESIDUAL, QUICK_SLOPE = RNG.standard_normal(N), RNG.standard_normal((N, T))
OWN, OWN_SLOPE, OTHER = RNG.standard_normal(N), RNG.standard_normal((N, T)), RNG.standard_normal(N)
# What the quick model's residual holds already of an earlier correction.
HELD = ElementCorrection(THETA - 0.2, RNG.standard_normal(N), RNG.standard_normal((N, T)))


class Fine(SimpleNamespace):
    def linearised(self, data: Any, theta: Any, contours: bool = False) -> Fine:
        return self


@pytest.fixture
def solvable(monkeypatch: pytest.MonkeyPatch) -> dict[str, bool]:
    """Which meshes have an equilibrium: of the better element on the case's own, of the quick one on the other."""
    has = {"own": True, "other": True}
    fine = Fine(residual=OWN, in_theta=OWN_SLOPE)
    monkeypatch.setattr(
        element_error, "fine_element_model", lambda model, element: element if model is not None else None
    )

    def own(better: object, hypothesis: object, at: Any) -> Any:
        assert (better, hypothesis) == (GOOD, PLAIN) and at.theta is not None
        return fine if has["own"] else None

    def elsewhere(better: object, hypothesis: object, at: object) -> Any:
        assert (better, hypothesis, at) == (GOOD, PLAIN, "there")
        return OTHER

    def solve(hypothesis: object, theta: Any, phi: Any, near: object) -> str | None:
        assert hypothesis is PLAIN and theta is THETA and not len(phi) and near is None
        return "there" if has["other"] else None

    def quick(geometry: object, data: Any, plain: object, correction: ElementCorrection) -> Any:
        assert (geometry, data.n, plain) == (("problem 2", QUICK, "geometry"), N, "as it is: problem 2")
        assert not correction.value.any()  # what the better element changes is counted without any
        return SimpleNamespace(solve=solve)

    monkeypatch.setattr(element_error, "fine_solution", own)
    monkeypatch.setattr(element_error, "fine_element_residual", elsewhere)
    monkeypatch.setattr(element_error, "SharedGeometry", SimpleNamespace(of=lambda *a: a))
    monkeypatch.setattr(element_error, "Composition", lambda problem: f"as it is: {problem}")
    monkeypatch.setattr(element_error, "StateModel", quick)
    return has


def errors(element: str = GOOD, others: int = 1) -> ElementErrors:
    model: Any = SimpleNamespace(
        data=SimpleNamespace(n=N), correction=HELD, plain=SimpleNamespace(problem="problem 1"), geometry="geometry"
    )
    at: Any = SimpleNamespace(
        theta=THETA, residual=QUICK_RESIDUAL + HELD.at(THETA), in_theta=QUICK_SLOPE + HELD.in_theta(THETA)
    )
    other: Any = SimpleNamespace(problem=lambda like: "problem 2" if like == "problem 1" else None)
    return element_errors(model, at, [other] * others, element)


def test_it_is_counted_from_the_quick_element_without_what_that_holds_of_it(solvable: dict[str, bool]) -> None:
    found = errors()
    np.testing.assert_allclose(found.every, [OWN - QUICK_RESIDUAL, OTHER - QUICK_RESIDUAL])
    np.testing.assert_allclose(found.slope, OWN_SLOPE - QUICK_SLOPE)
    np.testing.assert_allclose(found.quick, QUICK_RESIDUAL)
    assert found.on_own_mesh is not None
    np.testing.assert_allclose(found.on_own_mesh, OWN - QUICK_RESIDUAL)
    np.testing.assert_allclose(found.mean(), 0.5 * (OWN + OTHER) - QUICK_RESIDUAL)
    np.testing.assert_allclose(found.correction.at(THETA), found.mean())
    np.testing.assert_allclose(found.correction.in_theta(THETA), found.slope)


@pytest.mark.parametrize(("own", "other", "meshes"), [(False, True, 1), (True, False, 1), (False, False, 0)])
def test_a_mesh_without_an_equilibrium_tells_nothing(
    own: bool, other: bool, meshes: int, solvable: dict[str, bool]
) -> None:
    solvable.update(own=own, other=other)
    found = errors()
    assert found.every.shape == (meshes, N)
    assert (found.on_own_mesh is None) == (not own)
    np.testing.assert_allclose(found.slope, OWN_SLOPE - QUICK_SLOPE if own else np.zeros((N, T)))
    np.testing.assert_allclose(found.mean(), found.every.mean(axis=0) if meshes else np.zeros(N))


def test_the_quick_element_is_not_compared_with_itself(solvable: dict[str, bool]) -> None:
    found = errors(QUICK)
    assert found.every.shape == (0, N) and found.own is None and not found.slope.any()
    np.testing.assert_allclose(found.quick, QUICK_RESIDUAL)


def test_where_the_fit_moved_every_mesh_changes_as_the_case_s_own(
    solvable: dict[str, bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    before = errors()
    theta = THETA + 0.3
    there: Any = Fine(residual=OWN + 3.0, in_theta=2.0 * OWN_SLOPE)
    monkeypatch.setattr(
        element_error,
        "fine_solution",
        lambda better, hypothesis, at: there if (better, hypothesis) == (GOOD, PLAIN) and at.theta is theta else None,
    )
    model: Any = SimpleNamespace(data=None, correction=HELD)
    at: Any = SimpleNamespace(
        theta=theta, residual=QUICK_RESIDUAL + 1.0 + HELD.at(theta), in_theta=QUICK_SLOPE + HELD.in_theta(theta)
    )
    after = before.moved_to(model, at, GOOD)
    np.testing.assert_allclose(after.every, before.every + 2.0)
    np.testing.assert_allclose(after.quick, QUICK_RESIDUAL + 1.0)
    np.testing.assert_allclose(after.slope, 2.0 * OWN_SLOPE - QUICK_SLOPE)
    np.testing.assert_array_equal(after.theta, theta)
    monkeypatch.setattr(element_error, "fine_solution", lambda *a: None)
    assert before.moved_to(model, at, GOOD) is before
    solvable["own"] = False
    none_before = ElementErrors(before.every, None, before.quick, before.theta, before.slope)
    assert none_before.moved_to(model, at, GOOD) is none_before


def test_the_scatter_is_that_of_one_mesh_on_the_surface() -> None:
    """Three rows, of which two are modes of a surface of eight points."""
    data: Any = SimpleNamespace(n_modes=2, modes=np.zeros((8, 2)))
    differences = np.array([[1.0, 0.0, 9.0], [3.0, 0.0, 0.0], [2.0, 3.0, 5.0]])
    assert scatter_mm(differences, data) == pytest.approx(np.sqrt((1.0 + 3.0) / 8.0))
    assert np.isnan(scatter_mm(differences[:1], data))
