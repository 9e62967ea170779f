"""Direct and adjoint sensitivities against finite differences of whole solves, for every parameter of every law."""

from __future__ import annotations

import numpy as np
import pytest
from adjoint_sensitivity import adjoint

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box, with_regions
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.sensitivity import direct, response_to_forces
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.tangent import Tangent
from palpate.core.fem.terms.loads import nodal_force, traction
from palpate.core.laws import LAWS

SIZE = 10.0
TIGHT = NewtonOptions(rtol=1e-12)
BASE = {
    "mooney-rivlin": np.array([6.0, 9.0, 400.0]),
    "mooney-rivlin-printed": np.array([6.0, 9.0, 900.0]),
    "neo-hookean": np.array([30.0, 800.0]),
    "linear": np.array([20.0, 300.0]),
    "st-venant-kirchhoff": np.array([20.0, 100.0]),
}


def scene(element: str) -> tuple[Assembler, np.ndarray]:
    """A block with a soft half, pulled on its side while its top is moved; asymmetric in every direction."""
    mesh = with_regions(box([SIZE] * 3, (2, 2, 2), jitter=0.2, seed=5), lambda x: np.where(x[:, 0] > 5.0, 1, 3))
    space = Space.of(mesh, element)
    free = np.ones((space.n_nodes, 3), dtype=bool)
    goal = np.zeros((space.n_nodes, 3))
    top = np.isclose(space.nodes[:, 2], SIZE)
    free[np.isclose(space.nodes[:, 2], 0.0) | top] = False
    goal[top] = [1.2, 0.3, -1.0]
    faces, _ = mesh.boundary
    side = faces[np.isclose(mesh.points[faces][:, :, 0], SIZE).all(axis=1)]
    return Assembler(space, free.ravel(), [traction(space, side, np.array([1.0, 0.5, -0.2]))]), goal.ravel()


def solve(assembler: Assembler, goal: np.ndarray, law: str, p: np.ndarray) -> Equilibrium:
    materials = {1: Material(LAWS[law], p), 3: Material(LAWS["linear"], BASE["linear"])}
    if law == "linear":
        materials[3] = Material(LAWS["neo-hookean"], BASE["neo-hookean"])
    found = solve_equilibrium(assembler, materials, goal, options=TIGHT)
    assert found.converged, found.reason
    return found


def difference(f: object, h: float) -> np.ndarray:
    """Fourth-order central difference at 0."""
    return (8.0 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12.0 * h)  # type: ignore[operator,no-any-return]


# Every law in two elements; in the others one law suffices.
COMBINATIONS = [(element, law) for element in ("p1p1", "p2p1") for law in sorted(LAWS)]
COMBINATIONS += [(element, "mooney-rivlin") for element in ("p1", "p2", "p2p0")]


@pytest.mark.parametrize("element, law", COMBINATIONS)
def test_sensitivities_to_every_parameter(element: str, law: str) -> None:
    assembler, goal = scene(element)
    p = BASE.get(law, np.linspace(10.0, 200.0, len(LAWS[law].parameters)))
    found = solve(assembler, goal, law, p)
    directions = [{1: np.eye(len(p))[k]} for k in range(len(p))]
    du = direct(found.tangent, directions)
    gradient = np.random.default_rng(0).normal(size=found.u.shape)
    slopes = adjoint(found.tangent, directions, gradient)
    np.testing.assert_allclose(slopes, np.einsum("tni,ni->t", du, gradient), rtol=1e-8)
    for k in range(len(p)):
        numeric = difference(lambda s, k=k: solve(assembler, goal, law, p + s * np.eye(len(p))[k]).u, 2e-3 * p[k])
        assert np.abs(du[k] - numeric).max() < 1e-6 * np.abs(numeric).max(), LAWS[law].parameters[k]


def test_sensitivity_to_a_field_of_parameters() -> None:
    """One parameter per cell: the direction of a single cell's mu1."""
    assembler, goal = scene("p2p1")
    cells = int((assembler.space.mesh.regions == 1).sum())
    p = np.tile(BASE["mooney-rivlin"], (cells, 1))
    rate = np.zeros_like(p)
    rate[4, 0] = 1.0
    found = solve(assembler, goal, "mooney-rivlin", p)
    du = direct(found.tangent, [{1: rate}])[0]
    numeric = difference(lambda s: solve(assembler, goal, "mooney-rivlin", p + s * rate).u, 0.02)
    assert np.abs(du - numeric).max() < 1e-6 * np.abs(numeric).max()


def test_a_stale_factor_is_never_used() -> None:
    """Whatever is factorised, set or solved in between, a tangent answers as at first: it makes its factor again."""
    assembler, goal = scene("p2p1")
    found = solve(assembler, goal, "mooney-rivlin", BASE["mooney-rivlin"])
    state, directions = State(found.u, found.p), [{1: np.array([1.0, 0.0, 0.0])}]
    gradient = np.random.default_rng(0).normal(size=found.u.shape)
    expected, slopes = direct(found.tangent, directions), adjoint(found.tangent, directions, gradient)
    rest = State(0.0 * found.u, 0.0 * found.p)
    assembler.solver.factorise(assembler.tangent(rest, 1.0)[0])  # another state's, behind the tangent's back
    with_the_stale_one = Tangent.factorised(assembler, state, 1.0)
    assert np.abs(direct(with_the_stale_one, directions) - expected).max() > 1e-3 * np.abs(expected).max()
    np.testing.assert_array_equal(direct(found.tangent, directions), expected)
    softer = solve(assembler, goal, "mooney-rivlin", 0.5 * BASE["mooney-rivlin"])  # another model on the same solver
    terms, assembler.terms = assembler.terms, ()
    np.testing.assert_array_equal(adjoint(found.tangent, directions, gradient), slopes)
    np.testing.assert_array_equal(direct(found.tangent, directions), expected)
    assert np.abs(direct(softer.tangent, directions) - expected).max() > 1e-3 * np.abs(expected).max()
    assert assembler.terms == terms
    found.tangent.set_materials()
    afresh = Tangent(assembler, state)
    np.testing.assert_allclose(direct(afresh, directions), expected, rtol=1e-9, atol=1e-12)


def test_a_tangent_whose_factor_is_present_factorises_nothing() -> None:
    assembler, goal = scene("p1p1")
    found = solve(assembler, goal, "mooney-rivlin", BASE["mooney-rivlin"])
    made = assembler.solver.factorisations
    direct(found.tangent, [{1: np.array([1.0, 0.0, 0.0])}])
    assert assembler.solver.factorisations == made
    solve(assembler, goal, "mooney-rivlin", 0.5 * BASE["mooney-rivlin"])
    made = assembler.solver.factorisations
    direct(found.tangent, [{1: np.array([1.0, 0.0, 0.0])}])
    assert assembler.solver.factorisations == made + 1


def test_an_equilibrium_without_a_check_of_its_stability_has_no_tangent() -> None:
    assembler, goal = scene("p1p1")
    materials = {1: Material(LAWS["linear"], BASE["linear"]), 3: Material(LAWS["linear"], BASE["linear"])}
    found = solve_equilibrium(assembler, materials, goal, options=NewtonOptions(stability=False))
    assert found.converged
    with pytest.raises(ValueError, match="stability=True"):
        _ = found.tangent


@pytest.mark.parametrize("element", ["p1", "p2p1"])
def test_response_to_more_force(element: str) -> None:
    assembler, goal = scene(element)
    space, p = assembler.space, BASE["mooney-rivlin"]
    node = int(np.argmin(np.linalg.norm(space.nodes - [SIZE, 5.0, 5.0], axis=1)))
    force = np.array([[30.0, -20.0, 10.0]])
    nodal = np.zeros((1, space.n_nodes, 3))
    nodal[0, node] = force
    du = response_to_forces(solve(assembler, goal, "mooney-rivlin", p).tangent, nodal)[0]

    def with_force(s: float) -> np.ndarray:
        loaded = Assembler(space, assembler.free, [*assembler.terms, nodal_force(np.array([node]), s * force)])
        return solve(loaded, goal, "mooney-rivlin", p).u

    numeric = difference(with_force, 0.02)
    assert np.abs(du - numeric).max() < 1e-6 * np.abs(numeric).max()
