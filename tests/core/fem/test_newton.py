"""The equilibrium solve: right answers, few factorisations, any start, instability seen, failure as a value."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box, sphere_in_cube
from palpate.core.fem.newton.newton import Equilibrium, NewtonOptions, solve_equilibrium
from palpate.core.fem.newton.work import is_minimum
from palpate.core.fem.scenes import sphere_scene
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.loads import traction
from palpate.core.laws import MOONEY_RIVLIN, mooney_rivlin_parameters

ELEMENTS = ["p1", "p1p1", "p2", "p2p0", "p2p1"]
TIGHT = NewtonOptions(rtol=1e-11)


def pressed_block(
    element: str, stretch: float, material: Material, options: NewtonOptions | None = None
) -> Equilibrium:
    """A block between frictionless plates, its height set to `stretch` times its own."""
    space = Space.of(box([4.0, 5.0, 6.0], (2, 2, 3), jitter=0.2), element)
    free = np.ones((space.n_nodes, 3), dtype=bool)
    for axis in range(3):  # three planes of symmetry
        free[np.isclose(space.nodes[:, axis], 0.0), axis] = False
    top = np.isclose(space.nodes[:, 2], 6.0)
    free[top, 2] = False
    goal = np.zeros((space.n_nodes, 3))
    goal[top, 2] = 6.0 * (stretch - 1.0)
    return solve_equilibrium(Assembler(space, free.ravel()), {1: material}, goal.ravel(), options=options)


@pytest.mark.parametrize("stretch", [0.6, 1.4])
@pytest.mark.parametrize("element", ELEMENTS)
def test_a_pressed_block_widens_as_the_law_says(element: str, stretch: float) -> None:
    """40 % either way, nearly incompressible; the lateral stretch is the root of the lateral stress."""
    p = np.array([10.0, 6.0, 3000.0])
    found = pressed_block(element, stretch, Material(MOONEY_RIVLIN, p), TIGHT)
    assert found.converged, found.reason

    def lateral_stress(x: float) -> float:
        return float(MOONEY_RIVLIN.stress(np.diag([x, x, stretch]), p)[0, 0, 0])

    lateral = brentq(lateral_stress, 0.7, 1.4, xtol=1e-14)
    widest = found.u[:, :2].max(axis=0) if stretch < 1.0 else found.u[:, :2].min(axis=0)
    np.testing.assert_allclose(widest, (lateral - 1.0) * np.array([4.0, 5.0]), rtol=1e-7)


@pytest.mark.parametrize("element", ELEMENTS)
def test_a_cold_equilibrium_costs_few_factorisations(element: str) -> None:
    scene = sphere_scene(sphere_in_cube(2, 1, 2), element, 200.0)
    found = scene.solve()
    assert found.converged and found.stable and found.load == 1.0 and found.load_steps == 1
    assert found.residual <= 1e-8 and found.factorisations <= 4
    hasty = scene.solve(NewtonOptions(stability=False))
    assert hasty.converged and hasty.factorisations == found.factorisations - 1
    np.testing.assert_array_equal(hasty.u, found.u)


@pytest.mark.parametrize("element", ["p1", "p2"])
def test_a_large_bulk_modulus_costs_a_locking_element_nothing_extra(element: str) -> None:
    """Its points' pressures move with the displacement, so the stiff volume does not bend the path to the solution."""
    scenes = [sphere_scene(sphere_in_cube(3, 2, 3), element, ratio, "displacement") for ratio in (50.0, 10_000.0)]
    soft, stiff = (scene.solve() for scene in scenes)
    assert soft.converged and stiff.converged and stiff.load_steps == 1
    assert stiff.factorisations <= soft.factorisations == 2  # one, and the certificate
    assert max(soft.residual, stiff.residual) <= 1e-8  # of the element's own equations, without any pressure on its way


def test_the_same_solve_gives_the_same_bits() -> None:
    scene = sphere_scene(sphere_in_cube(2, 1, 2), "p2p1", 200.0)
    first = scene.solve()
    other = sphere_scene(sphere_in_cube(1, 1, 1), "p2p1", 50.0)
    other.solve()
    np.testing.assert_array_equal(scene.solve().u, first.u)


def test_every_start_ends_in_the_same_place() -> None:
    scene = sphere_scene(sphere_in_cube(2, 1, 2), "p2p1", 200.0, "displacement")
    reference = scene.solve(TIGHT)
    scale = np.abs(reference.u).max()
    rng = np.random.default_rng(0)
    noise = rng.normal(size=reference.u.shape)
    holed = reference.u.copy()
    holed[3] = np.nan
    starts = {
        "its own solution": State(reference.u, reference.p),
        "near by": reference.u + 0.02 * noise,
        "inverted": 20.0 * noise,
        "not finite": holed,
        "pressure not finite": State(reference.u, np.full_like(reference.p, np.inf)),
    }
    for name, start in starts.items():
        found = scene.solve(TIGHT, start)
        assert found.converged, f"{name}: {found.reason}"
        assert np.abs(found.u - reference.u).max() < 1e-7 * scale, name
    warm = scene.solve(NewtonOptions(), State(reference.u, reference.p))
    assert warm.factorisations == 1  # only the certificate


def test_a_whole_turn_of_the_boundary_turns_the_body() -> None:
    """All of the surface turned by 90 degrees: found from rest, through load steps that are no rotations, with no energy left."""
    space = Space.of(box([4.0, 4.0, 4.0], (2, 2, 2), jitter=0.2), "p2p1")
    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    x = space.nodes - 2.0
    inner = np.abs(x).max(axis=1) < 2.0 - 1e-9
    exact = x @ R.T - x
    assembler = Assembler(space, np.repeat(inner, 3))
    material = {1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(40.0, 200.0))}
    found = solve_equilibrium(assembler, material, exact.ravel(), options=TIGHT)
    assert found.converged, found.reason
    assert np.abs(found.u - exact).max() < 1e-9
    assert abs(assembler.energy(found.u, 1.0)) < 1e-10 * 40.0 * 64.0


LENGTH, WIDTH, G, K = 10.0, 2.5, 20.0, 400.0
YOUNG = 9.0 * K * G / (3.0 * K + G)
EULER = np.pi**2 * YOUNG * WIDTH**4 / 12.0 / (4.0 * LENGTH**2)  # mN, foot held, top free


def column(element: str, load_over_euler: float) -> Assembler:
    """A slender column that stands on its foot and carries a dead load."""
    space = Space.of(box([WIDTH, WIDTH, LENGTH], (2, 2, 6)), element)
    faces, _ = space.mesh.boundary
    top = faces[np.isclose(space.mesh.points[faces][:, :, 2], LENGTH).all(axis=1)]
    load = traction(space, top, np.array([0.0, 0.0, -load_over_euler * EULER / WIDTH**2]))
    return Assembler(space, np.repeat(~np.isclose(space.nodes[:, 2], 0.0), 3), [load])


COLUMN = {1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(G, K))}


@pytest.mark.parametrize("element", ["p2", "p2p1"])
@pytest.mark.parametrize(("load_over_euler", "falling"), [(0.9, 0), (1.4, 2)])
def test_the_straight_column_is_seen_to_be_unstable_beyond_eulers_load(
    element: str, load_over_euler: float, falling: int
) -> None:
    """The straight state, found by holding the sides; set free, it has two directions in which the energy falls, or none."""
    loose = column(element, load_over_euler)
    held = loose.free.reshape(-1, 3).copy()
    held[:, :2] &= np.abs(loose.space.nodes[:, :2] - WIDTH / 2).max(axis=1)[:, None] > 1e-9  # the axis stays straight
    guided = Assembler(loose.space, held.ravel(), loose.terms)
    straight = solve_equilibrium(guided, COLUMN)
    assert straight.converged, straight.reason
    loose.set_materials(COLUMN)
    loose.solver.factorise(loose.tangent(State(straight.u, straight.p), 1.0)[0])
    assert loose.solver.n_negative() - loose.space.n_pressures == falling
    assert is_minimum(loose) == (falling == 0)


def test_an_overloaded_column_is_followed_to_its_bent_stable_state() -> None:
    assembler = column("p2p1", 1.3)
    found = solve_equilibrium(assembler, COLUMN)
    assert found.converged and found.stable, found.reason
    sideways = np.linalg.norm(found.u[:, :2], axis=1).max()
    assert sideways > 0.3 * LENGTH  # the elastica bends far soon after Euler's load
    assert found.residual <= 1e-8 and found.buckled
    straight = solve_equilibrium(assembler, COLUMN, options=NewtonOptions(follow_buckling=False))
    assert not straight.converged and not straight.buckled
    assert "loses its stability under this load (it buckles)" in straight.reason
    assert 0.8 < 1.3 * straight.load < 1.3  # where Euler says, within what a stocky column and a coarse mesh allow


def test_what_has_no_equilibrium_is_said_and_stays_finite() -> None:
    """The top pushed through the bottom: no state keeps J > 0."""
    found = pressed_block("p2p1", -0.3, Material(MOONEY_RIVLIN, np.array([10.0, 6.0, 3000.0])))
    assert not found.converged
    assert found.reason.startswith("stopped at ") and " % of the load: " in found.reason
    assert 0.0 < found.load < 1.0 and np.isfinite(found.u).all() and np.isfinite(found.p).all()
    assert found.min_jacobian > 0.0
    assert found.factorisations <= NewtonOptions().max_factorisations + 2


def test_the_work_cap_is_kept_and_said() -> None:
    scene = sphere_scene(sphere_in_cube(2, 1, 2), "p2p1", 200.0, "displacement")
    found = scene.solve(NewtonOptions(max_factorisations=1, rtol=1e-14))
    assert not found.converged
    assert "the cap of 1 factorisations was reached" in found.reason
