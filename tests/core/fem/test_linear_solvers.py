"""Both direct solvers give the same answers and inertia; what cannot be factorised is said."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear import pardiso
from palpate.core.fem.linear.choice import FactorisationError, make_solver
from palpate.core.fem.linear.pattern import Pattern
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.loads import traction
from palpate.core.laws import MOONEY_RIVLIN, mooney_rivlin_parameters

SOLVERS = ["pardiso", "superlu"]


def available(name: str, pattern: Pattern):  # type: ignore[no-untyped-def]
    try:
        return make_solver(pattern, name)
    except (ImportError, OSError) as error:
        pytest.skip(f"{name} is not on this machine: {error}")


def assembler_of(element: str, solver: str) -> Assembler:
    space = Space.of(box([10.0, 8.0, 6.0], (3, 3, 3), jitter=0.2), element)
    faces, _ = space.mesh.boundary
    top = faces[np.isclose(space.mesh.points[faces][:, :, 2], 6.0).all(axis=1)]
    free = np.repeat(~np.isclose(space.nodes[:, 2], 0.0), 3)
    available(solver, Pattern.of([np.array([[0, 1]])], np.arange(2)))
    return Assembler(space, free, [traction(space, top, np.array([3.0, 1.0, -4.0]))], solver)


MATERIAL = {1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(40.0, 2000.0))}


@pytest.mark.parametrize("element", ["p1", "p1p1", "p2p0", "p2p1"])
def test_solvers_agree_on_solution_and_inertia(element: str) -> None:
    found, signs = [], []
    for name in SOLVERS:
        assembler = assembler_of(element, name)
        found.append(solve_equilibrium(assembler, MATERIAL))
        assert found[-1].converged, f"{name}: {found[-1].reason}"
        signs.append(assembler.solver.n_negative())
        # A state squeezed in one direction by a third: the tangent of the plain problem has lost definiteness.
        squeezed = assembler.space.nodes * [0.0, 0.0, -0.3] * np.sin(assembler.space.nodes[:, :1])
        rough = State(squeezed, np.linspace(-500.0, 300.0, assembler.space.n_pressures))
        assembler.solver.factorise(assembler.tangent(rough, 1.0)[0])
        signs.append(assembler.solver.n_negative())
    scale = np.abs(found[0].u).max()
    assert np.abs(found[0].u - found[1].u).max() < 1e-7 * scale
    assert signs[:2] == signs[2:]
    assert signs[0] == assembler.space.n_pressures


def random_matrix(seed: int, n: int = 40) -> tuple[Pattern, np.ndarray, np.ndarray]:
    """A sparse symmetric matrix of small blocks: pattern, upper values, dense form."""
    rng = np.random.default_rng(seed)
    blocks = np.stack([rng.choice(n, 5, replace=False) for _ in range(30)])
    pattern = Pattern.of([blocks], np.arange(n))
    values = rng.normal(size=len(pattern.indices))
    upper = pattern.matrix(values).toarray()
    diagonal = np.where(np.arange(n) < n // 3, -6.0, 8.0)
    dense = upper + np.triu(upper, 1).T + np.diag(diagonal)
    values[pattern.indptr[:-1]] += diagonal  # the diagonal leads every row
    return pattern, values, dense


@pytest.mark.parametrize("name", SOLVERS)
def test_indefinite_systems_with_many_right_hand_sides(name: str) -> None:
    pattern, values, dense = random_matrix(1)
    solver = available(name, pattern)
    solver.factorise(values)
    b = np.random.default_rng(2).normal(size=(pattern.n, 3))
    np.testing.assert_allclose(dense @ solver.solve(b), b, atol=1e-9)
    np.testing.assert_allclose(dense @ solver.solve(b[:, 0]), b[:, 0], atol=1e-9)
    assert solver.n_negative() == int((np.linalg.eigvalsh(dense) < 0.0).sum())


@pytest.mark.parametrize("name", SOLVERS)
def test_values_that_are_not_finite_are_refused(name: str) -> None:
    pattern, values, _ = random_matrix(3)
    solver = available(name, pattern)
    values[5] = np.nan
    with pytest.raises(FactorisationError, match="not finite"):
        solver.factorise(values)


@pytest.mark.parametrize("name", SOLVERS)
def test_a_solver_survives_a_refused_matrix(name: str) -> None:
    pattern, values, dense = random_matrix(4)
    solver = available(name, pattern)
    with pytest.raises(FactorisationError, match="not finite"):
        solver.factorise(np.full_like(values, np.inf))
    solver.factorise(values)
    b = np.ones(pattern.n)
    np.testing.assert_allclose(dense @ solver.solve(b), b, atol=1e-9)


def test_mkl_is_found_without_a_search_of_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    available("pardiso", Pattern.of([np.array([[0, 1]])], np.arange(2)))
    if pardiso._mkl_library() is None:
        pytest.skip("MKL is not here as the wheel mkl")

    def search(*_: object, **__: object) -> list[str]:
        raise AssertionError("the environment was searched")

    monkeypatch.setattr("glob.glob", search)
    monkeypatch.delenv("PYPARDISO_MKL_RT", raising=False)
    assert callable(pardiso.mkl_pardiso.__wrapped__())


def test_superlu_says_that_it_has_no_factor_yet() -> None:
    pattern, _, _ = random_matrix(5)
    with pytest.raises(FactorisationError, match="before factorise"):
        make_solver(pattern, "superlu").solve(np.ones(pattern.n))


@pytest.mark.parametrize("scale", [1e-200, 1e-40, 1.0, 1e40, 1e150])
def test_the_size_of_the_numbers_does_not_matter(scale: float) -> None:
    """Single precision alone ends at 1e38, and PARDISO does not survive an overflow."""
    pattern, values, dense = random_matrix(6)
    solver = available("pardiso", pattern)
    solver.factorise(scale * values)
    b = np.random.default_rng(7).normal(size=(pattern.n, 2)) * [1e-50, 1e50]
    x = solver.solve(b)
    np.testing.assert_allclose(scale * (dense @ x[:, 1]), b[:, 1], rtol=1e-9, atol=1e-9 * 1e50)
    assert solver.n_negative() == int((np.linalg.eigvalsh(dense) < 0.0).sum())


def test_where_single_precision_fails_double_serves() -> None:
    """A matrix with condition 1e11, beyond refinement from single precision: exact answers all the same."""
    pattern, values, dense = random_matrix(8)
    lowest = np.linalg.eigvalsh(dense)
    shift = lowest[lowest > 0.0][0] - 1e-10
    values[pattern.indptr[:-1]] -= shift
    dense -= shift * np.eye(len(dense))
    solver = available("pardiso", pattern)
    solver.factorise(values)
    x = np.random.default_rng(9).normal(size=pattern.n)
    found = solver.solve(dense @ x)
    assert np.linalg.norm(dense @ (found - x)) < 1e-10 * np.linalg.norm(dense @ x)
    assert np.linalg.norm(found - x) < 1e-3 * np.linalg.norm(x)


def test_walls_far_stiffer_than_the_tissue_leave_the_factor_in_single_precision(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Springs a million times as stiff as the body on one face: pivots of pressure unknowns are not lost beside them."""
    assembler = assembler_of("p1p1", "pardiso")
    assembler.set_materials(MATERIAL)
    state = State(np.zeros_like(assembler.space.nodes), np.zeros(assembler.space.n_pressures))
    values = assembler.tangent(state, 1.0)[0].copy()
    diagonal = assembler.pattern.indptr[:-1]
    stiff = diagonal[: assembler.n_free : 7]
    values[stiff] += 1e6 * np.abs(values[diagonal[: assembler.n_free]]).max()
    monkeypatch.setattr(
        pardiso.Pardiso, "_factorise_in_double", lambda solver: pytest.fail("double precision was used")
    )
    assembler.solver.factorise(values)
    x = np.random.default_rng(11).normal(size=assembler.pattern.n)
    x[: assembler.n_free : 7] *= 1e-6
    upper = assembler.pattern.matrix(values)
    b = upper @ x + upper.T @ x - values[diagonal] * x
    assert np.linalg.norm(assembler.solver.solve(b) - x) < 1e-9 * np.linalg.norm(x)
    assert np.linalg.norm(assembler.solver.solve_roughly(b) - x) < 1e-3 * np.linalg.norm(x)
    assert assembler.solver.n_negative() == assembler.space.n_pressures
