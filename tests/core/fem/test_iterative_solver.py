"""The iterative solver: answers and inertia of the direct one, a cycle that does not slow down with the mesh, a factor where it must."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import linalg

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.linear import choice
from palpate.core.fem.linear.choice import FactorisationError, Iterative, make_solver
from palpate.core.fem.linear.two_level import Levels, TwoLevel
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box
from palpate.core.fem.newton.newton import NewtonOptions, solve_equilibrium
from palpate.core.fem.sensitivity import direct
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.loads import traction
from palpate.core.laws import MOONEY_RIVLIN, mooney_rivlin_parameters

MATERIAL = {1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(40.0, 4000.0))}


def body(solver: str, divisions: int = 3) -> Assembler:
    """A block on a fixed floor, on which a face also slides along x, pulled at its top."""
    space = Space.of(box([10.0, 8.0, 6.0], (divisions,) * 3, jitter=0.2), "p2p1")
    faces, _ = space.mesh.boundary
    top = faces[np.isclose(space.mesh.points[faces][:, :, 2], 6.0).all(axis=1)]
    free = np.ones((space.n_nodes, 3), dtype=bool)
    free[np.isclose(space.nodes[:, 2], 0.0)] = False
    free[np.isclose(space.nodes[:, 0], 0.0), 1:] = False
    return Assembler(space, free.ravel(), [traction(space, top, np.array([6.0, 2.0, -8.0]))], solver)


def test_same_equilibrium_inertia_and_sensitivities_as_the_direct_solver() -> None:
    found = {}
    for name in ("auto", "iterative"):
        assembler = body(name)
        end = solve_equilibrium(assembler, MATERIAL, options=NewtonOptions(rtol=1e-11))
        assert end.converged, end.reason
        rates = direct(end.tangent, [{1: mooney_rivlin_parameters(40.0, 4000.0)}])
        found[name] = end.u, rates, assembler.solver.n_negative()
    (u, rates, negative), (u_i, rates_i, negative_i) = found["auto"], found["iterative"]
    assert np.abs(u_i - u).max() < 1e-8 * np.abs(u).max()
    assert np.abs(rates_i - rates).max() < 1e-8 * np.abs(rates).max()
    assert negative_i == negative == body("auto").space.n_pressures


def solvers(state_of) -> tuple[Iterative, choice.SymmetricSolver, int]:  # type: ignore[no-untyped-def]
    """Both solvers with the tangent at a state of the body."""
    made = []
    for name in ("iterative", "auto"):
        assembler = body(name)
        assembler.set_materials(MATERIAL)
        assembler.solver.factorise(assembler.tangent(state_of(assembler.space), 1.0)[0])
        made.append(assembler.solver)
    assert isinstance(made[0], Iterative)
    return made[0], made[1], len(assembler.kept)


def at_rest(space: Space) -> State:
    return State(np.zeros((space.n_nodes, 3)), np.zeros(space.n_pressures))


def test_solutions_to_round_off_one_by_one_and_by_a_factor_for_many() -> None:
    iterative, factor, n = solvers(at_rest)
    b = np.random.default_rng(3).normal(size=(n, 5))
    exact = factor.solve(b)
    for columns in (b[:, :1], b):
        x = iterative.solve(columns)
        assert x.shape == columns.shape
        assert np.linalg.norm(x - exact[:, : x.shape[1]]) < 1e-9 * np.linalg.norm(exact[:, : x.shape[1]])
    one = iterative.solve(b[:, 0])
    assert one.shape == (n,)
    assert not iterative.solve(np.zeros(n)).any()


def test_rough_solutions_are_rough() -> None:
    iterative, factor, n = solvers(at_rest)
    b = np.random.default_rng(4).normal(size=n)
    off = np.linalg.norm(iterative.solve_roughly(b) - factor.solve(b)) / np.linalg.norm(factor.solve(b))
    assert 1e-12 < off < 1e-2


def test_where_the_stiffness_is_no_longer_definite_the_inertia_is_that_of_a_factor() -> None:
    """Pressures far beyond the shear modulus make K indefinite by itself."""

    def under_pressure(space: Space) -> State:
        return State(np.zeros((space.n_nodes, 3)), np.full(space.n_pressures, 400.0))

    iterative, factor, n = solvers(under_pressure)
    assert factor.n_negative() > body("auto").space.n_pressures
    assert iterative.n_negative() == factor.n_negative()
    b = np.random.default_rng(5).normal(size=n)
    assert np.linalg.norm(iterative.solve(b) - factor.solve(b)) < 1e-8 * np.linalg.norm(factor.solve(b))


def test_an_iteration_that_does_not_converge_ends_in_a_factor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("palpate.core.fem.linear.iterative._DIRECTIONS", 2)
    monkeypatch.setattr("palpate.core.fem.linear.iterative._RESTARTS", 1)
    iterative, factor, n = solvers(at_rest)
    b = np.random.default_rng(6).normal(size=n)
    assert np.linalg.norm(iterative.solve(b) - factor.solve(b)) < 1e-9 * np.linalg.norm(factor.solve(b))


def test_nothing_is_solved_without_a_matrix_or_with_one_that_is_not_finite() -> None:
    assembler = body("iterative")
    assembler.set_materials(MATERIAL)
    for ask in (lambda s: s.solve(np.zeros(len(assembler.kept))), lambda s: s.n_negative()):
        with pytest.raises(FactorisationError, match="before factorise"):
            ask(assembler.solver)
    with pytest.raises(FactorisationError, match="not finite"):
        assembler.solver.factorise(np.full(len(assembler.pattern.indices), np.nan))


def levels_of(assembler: Assembler) -> Levels:
    space = assembler.space
    return Levels.of(assembler.free, len(space.mesh.points), space.edge_ends)


def test_linear_displacements_are_prolonged_exactly() -> None:
    space = Space.of(box([10.0, 8.0, 6.0], (2, 2, 2), jitter=0.2), "p2p1")
    levels = Levels.of(np.ones(space.n_displacements, dtype=bool), len(space.mesh.points), space.edge_ends)
    linear = space.nodes @ np.array([[0.3, -0.1, 0.2], [0.0, 0.5, 0.1], [0.2, 0.2, -0.4]])
    coarse = linear[: len(space.mesh.points)].ravel()
    assert np.allclose(levels.prolongation @ coarse, linear.ravel(), atol=1e-5)


def steps_of(divisions: int) -> int:
    """Of conjugate gradients with the cycle on a body's K, whose symmetry is asserted on the way."""
    assembler = body("iterative", divisions)
    assembler.set_materials(MATERIAL)
    assembler.solver.factorise(assembler.tangent(at_rest(assembler.space), 1.0)[0])
    cycle: TwoLevel = assembler.solver._two_level  # type: ignore[attr-defined]
    x, y = np.random.default_rng(7).normal(size=(2, assembler.n_free))
    assert abs(x @ cycle.apply(y) - y @ cycle.apply(x)) < 1e-4 * abs(x @ cycle.apply(x))
    steps: list[int] = []
    operator = linalg.LinearOperator(cycle.matrix.shape, matvec=cycle.apply, dtype=np.float64)
    linalg.cg(cycle.matrix.astype(float), x, rtol=1e-5, M=operator, callback=steps.append)
    return len(steps)


def test_the_cycle_is_symmetric_and_does_not_slow_down_with_the_mesh() -> None:
    """Fourteen times the unknowns take as many steps, where no preconditioner would take two and a half times as many."""
    coarse, fine = steps_of(2), steps_of(5)
    assert fine <= coarse + 2


def test_the_iterative_solver_takes_over_for_large_matrices_of_the_element_that_it_serves(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pattern, levels = body("auto").pattern, levels_of(body("auto"))
    assert make_solver(pattern, "auto", levels).name != "iterative"
    monkeypatch.setattr(choice, "TAKES_OVER", 100)
    assert make_solver(pattern, "auto", levels).name == "iterative"
    assert make_solver(pattern, "auto").name != "iterative"
    with pytest.raises(ValueError, match="pressures at vertices"):
        make_solver(pattern, "iterative")
