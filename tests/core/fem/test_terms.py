"""Terms against finite differences and closed forms: loads, follower pressure, springs, walls."""

from __future__ import annotations

import numpy as np
import pytest
from term_blocks import SIZE, TIGHT, block, faces_at, held_below, sphere_distance, without_lateral_strain

from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import onion
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term, face_points
from palpate.core.fem.terms.loads import body_force, nodal_force, traction
from palpate.core.fem.terms.pressure import FollowerPressure
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.laws import MOONEY_RIVLIN, mooney_rivlin_parameters
from palpate.core.mesh import TetMesh


def example_terms(space: Space) -> dict[str, Term]:
    faces, _ = space.mesh.boundary
    top = faces_at(space, 2, SIZE[2])
    points = face_points(space.nodes, space.face_nodes(top))
    S = np.array([[3.0, 1.0, 0.0], [1.0, 4.0, 0.5], [0.0, 0.5, 5.0]])
    return {
        "traction": traction(space, top, np.array([1.0, -2.0, 3.0])),
        "body force": body_force(space, np.array([0.1, 0.2, -0.3]), (1,)),
        "nodal force": nodal_force(np.array([3, 5]), np.array([[1.0, 2.0, 3.0], [0.0, -1.0, 4.0]])),
        "follower pressure": FollowerPressure.on(space, faces, 3.0),
        "springs": Springs(points, S, np.array([0.1, 0.2, 0.3])),
        "wall": SlidingWall.between(points, points.positions(space.nodes), sphere_distance, sphere_distance, 50.0),
    }


@pytest.mark.parametrize("element", ["p1", "p2"])
@pytest.mark.parametrize("name", ["traction", "body force", "nodal force", "follower pressure", "springs", "wall"])
def test_gradient_and_tangent_of_a_term_are_derivatives_of_its_energy(name: str, element: str) -> None:
    space = block(element)
    term = example_terms(space)[name]
    rng = np.random.default_rng(3)
    # The wall's tangent leaves out its gap times its curvature: exact where the gap is small.
    size = 1e-5 if name == "wall" else 0.2
    u, d, load = size * rng.normal(size=space.nodes.shape), rng.normal(size=space.nodes.shape), 0.7
    if name == "wall":
        load = 1.0

    def assembled(blocks: np.ndarray) -> np.ndarray:
        out = np.zeros(3 * space.n_nodes)
        np.add.at(out, term.unknowns, blocks)
        return out

    h = 1e-4
    _, gradient, tangent = term.evaluate(u, load, 2)
    slope = (term.evaluate(u + h * d, load, 0)[0] - term.evaluate(u - h * d, load, 0)[0]) / (2 * h)
    assert assembled(gradient) @ d.ravel() == pytest.approx(slope, rel=1e-6)
    turned = [assembled(term.evaluate(u + s * h * d, load, 1)[1]) for s in (1, -1)]
    numeric = (turned[0] - turned[1]) / (2 * h)
    analytic = assembled(np.einsum("bij,bj->bi", tangent, d.ravel()[term.unknowns]))
    # A face's own follower tangent is not symmetric; only the sum over a closed surface is.
    scale = np.abs(analytic).max()
    assert np.abs(analytic - numeric).max() <= (2e-4 if name == "wall" else 1e-6) * max(scale, 1e-9)


@pytest.mark.parametrize("element", ["p1", "p2p1"])
def test_a_pulled_bar_stretches_by_hooke(element: str) -> None:
    space = block(element)
    load = traction(space, faces_at(space, 2, SIZE[2]), np.array([0.0, 0.0, 3.0]))
    found = solve_equilibrium(
        Assembler(space, held_below(space), [load]), {1: without_lateral_strain(60.0)}, options=TIGHT
    )
    np.testing.assert_allclose(found.u, space.nodes * [0.0, 0.0, 3.0 / 60.0], atol=1e-11)


def test_a_column_sinks_under_its_own_weight() -> None:
    """u_z = -b (h z - z^2 / 2) / E, which the quadratic element holds exactly."""
    space = block("p2")
    load = body_force(space, np.array([0.0, 0.0, -0.5]))
    found = solve_equilibrium(
        Assembler(space, held_below(space), [load]), {1: without_lateral_strain(60.0)}, options=TIGHT
    )
    z = space.nodes[:, 2]
    np.testing.assert_allclose(found.u[:, 2], -0.5 * (SIZE[2] * z - 0.5 * z**2) / 60.0, atol=1e-11)


def test_a_bar_on_springs_is_two_springs_in_series() -> None:
    """Displacement d of the springs' far ends: the bar's top takes d / (1 + E / (h k))."""
    space = block("p2")
    points = face_points(space.nodes, space.face_nodes(faces_at(space, 2, SIZE[2])))
    k, d, E = 8.0, 0.3, 60.0
    springs = Springs(points, np.diag([0.0, 0.0, k]), np.array([0.0, 0.0, d]))
    found = solve_equilibrium(
        Assembler(space, held_below(space), [springs]), {1: without_lateral_strain(E)}, options=TIGHT
    )
    top = d / (1.0 + E / (SIZE[2] * k))
    np.testing.assert_allclose(found.u[:, 2], top * space.nodes[:, 2] / SIZE[2], atol=1e-11)


@pytest.mark.parametrize("element", ["p1", "p2p1"])
def test_hydrostatic_pressure_shrinks_a_block_evenly(element: str) -> None:
    """Follower pressure on a closed surface: F = J^(1/3) 1 with 2 v1 (J - 1) = -p."""
    space = block(element)
    p, K = 40.0, 200.0
    term = FollowerPressure.on(space, space.mesh.boundary[0], p)
    free = np.ones((space.n_nodes, 3), dtype=bool)
    for node, components in ((SIZE * 0, (0, 1, 2)), (SIZE * [1, 0, 0], (1, 2)), (SIZE * [0, 1, 0], (2,))):
        free[np.flatnonzero((np.abs(space.nodes - node) < 1e-9).all(axis=1))[0], list(components)] = False
    material = Material(MOONEY_RIVLIN, mooney_rivlin_parameters(20.0, K))
    found = solve_equilibrium(Assembler(space, free.ravel(), [term]), {1: material}, options=TIGHT)
    assert found.converged, found.reason
    stretch = (1.0 - p / K) ** (1.0 / 3.0)
    np.testing.assert_allclose(found.u, (stretch - 1.0) * space.nodes, atol=1e-10)


def test_a_follower_pressure_with_a_free_border_is_refused() -> None:
    for element, loose in (("p1", 1), ("p2", 5)):
        space = block(element)
        term = FollowerPressure.on(space, faces_at(space, 2, SIZE[2]), 1.0)
        free = np.ones((space.n_nodes, 3), dtype=bool)
        rim = np.isclose(space.nodes[:, 2], SIZE[2]) & (np.isclose(space.nodes, 0.0) | np.isclose(space.nodes, SIZE))[
            :, :2
        ].any(1)
        free[rim] = False
        Assembler(space, free.ravel(), [term])  # a held border is fine
        free[np.flatnonzero(rim)[:loose]] = True
        with pytest.raises(InputError, match=f"open border has {loose} nodes that can move"):
            Assembler(space, free.ravel(), [term])


def hollow_sphere(n: int, layers: int, inner: float, outer: float) -> TetMesh:
    """Thick spherical shell of region 1 between two radii, mm."""
    return onion(n, [(layers, lambda s, c, d: d * inner * (outer / inner) ** s, 1)], None)


def mean_inner_motion(n: int, a: float, b: float, material: Material, p: float) -> float:
    """Mean radial displacement of the inner surface of a thick sphere under inner follower pressure, mm."""
    space = Space.of(hollow_sphere(n, 3, a, b), "p2p1")
    faces, _ = space.mesh.boundary
    inner = np.linalg.norm(space.mesh.points[faces], axis=2).max(axis=1) < 0.5 * (a + b)
    free = np.ones((space.n_nodes, 3), dtype=bool)
    for node, components in (([b, 0, 0], (1, 2)), ([0, b, 0], (0, 2)), ([0, 0, b], (0, 1))):
        free[np.argmin(np.linalg.norm(space.nodes - node, axis=1)), list(components)] = False
    found = solve_equilibrium(
        Assembler(space, free.ravel(), [FollowerPressure.on(space, faces[inner], p)]), {1: material}
    )
    assert found.converged, found.reason
    vertices = np.unique(faces[inner])
    return float(np.einsum("ni,ni->n", found.u[vertices], space.nodes[vertices]).mean()) / a


def test_a_thick_sphere_under_inner_pressure_follows_lame() -> None:
    """u_r(a) = p a^3 / (b^3 - a^3) (a / (3 K) + b^3 / (4 G a^2)) for small pressure (Timoshenko & Goodier, art. 142).

    Flat faces lie inside the sphere by O(h^2): two meshes, extrapolated.
    """
    a, b, G, K, p = 5.0, 10.0, 20.0, 400.0, 0.02
    material = Material(MOONEY_RIVLIN, mooney_rivlin_parameters(G, K))
    coarse, fine = (mean_inner_motion(n, a, b, material, p) for n in (3, 6))
    exact = p * a**3 / (b**3 - a**3) * (a / (3.0 * K) + b**3 / (4.0 * G * a**2))
    assert (4.0 * fine - coarse) / 3.0 == pytest.approx(exact, rel=0.005)
