"""Bodies that meet other bodies: interfaces cut open, and walls that slide."""

from __future__ import annotations

import numpy as np
import pytest
from term_blocks import SIZE, TIGHT, block, faces_at, held_below, sphere_distance, without_lateral_strain

from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box, with_regions
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import face_points
from palpate.core.fem.terms.interface import open_interface
from palpate.core.fem.terms.loads import traction
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import SlidingWall
from palpate.core.forward.cut_interface import sliding_springs
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, mooney_rivlin_parameters


def stacked(element: str, opened: bool, stiffness: tuple[float, float] = (0.0, 0.0)) -> tuple[Space, list[Springs]]:
    """Two regions of a box that meet at z = 3: 1 below, 3 above; conforming, or opened and joined by springs."""
    mesh = with_regions(box(SIZE, (2, 2, 4)), lambda x: np.where(x[:, 2] < 3.0, 1, 3))
    if not opened:
        return Space.of(mesh, element), []
    split = open_interface(mesh, (1,))
    space = Space.of(split.mesh, element)
    return space, [sliding_springs(space, split, *stiffness)]


@pytest.mark.parametrize("element", ["p1", "p2p1"])
def test_a_tied_interface_tends_to_the_conforming_result(element: str) -> None:
    """The difference falls like 1 / stiffness."""
    materials = {
        1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(40.0, 400.0)),
        3: Material(LINEAR, np.array([20.0, 200.0])),
    }
    found = []
    for opened, k in ((False, 0.0), (True, 1e4), (True, 1e5)):
        space, terms = stacked(element, opened, (k, k))
        free = np.ones((space.n_nodes, 3), dtype=bool)
        goal = np.zeros((space.n_nodes, 3))
        top = np.isclose(space.nodes[:, 2], SIZE[2])
        free[np.isclose(space.nodes[:, 2], 0.0) | top] = False
        goal[top] = [0.5, 0.0, -0.4]
        result = solve_equilibrium(Assembler(space, free.ravel(), terms), materials, goal.ravel())
        assert result.converged, result.reason
        n = len(space.mesh.points) if not opened else len(np.unique(np.round(space.mesh.points, 9), axis=0))
        found.append(result.u[:n])
    errors = [np.abs(u - found[0]).max() for u in found[1:]]
    assert errors[1] < 1e-3 * np.abs(found[0]).max()
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.1)


def test_a_sliding_interface_carries_pressure_and_no_shear() -> None:
    """Two bars and a spring in series across; along, the upper block moves as a whole and the lower not at all."""
    E1, E2, k, down, along = 30.0, 60.0, 500.0, 0.2, 0.7
    space, terms = stacked("p1", True, (k, 0.0))  # one spring a node meets an even pressure exactly in linear elements
    free = np.ones((space.n_nodes, 3), dtype=bool)
    goal = np.zeros((space.n_nodes, 3))
    top = np.isclose(space.nodes[:, 2], SIZE[2])
    free[np.isclose(space.nodes[:, 2], 0.0) | top] = False
    goal[top] = [along, 0.0, -down]
    materials = {1: without_lateral_strain(E1), 3: without_lateral_strain(E2)}
    found = solve_equilibrium(Assembler(space, free.ravel(), terms), materials, goal.ravel(), options=TIGHT)
    assert found.converged, found.reason
    pressure = down / (3.0 / E1 + 3.0 / E2 + 1.0 / k)
    lower = np.isin(np.arange(space.n_nodes), space.cell_nodes[space.mesh.regions == 1])
    z = space.nodes[:, 2]
    np.testing.assert_allclose(found.u[lower], np.outer(z[lower], [0.0, 0.0, -pressure / E1]), atol=1e-10)
    upper = np.outer(SIZE[2] - z[~lower], [0.0, 0.0, pressure / E2]) + [along, 0.0, -down]
    np.testing.assert_allclose(found.u[~lower], upper, atol=1e-10)


def test_an_interface_between_regions_that_do_not_touch_is_refused() -> None:
    with pytest.raises(InputError, match="share no face"):
        open_interface(box(SIZE, (1, 1, 1)), (1,))


def plane(height: float) -> object:
    """Signed distance of the half space below z = height."""
    return lambda x: (x[:, 2] - height, np.broadcast_to([0.0, 0.0, 1.0], x.shape))


@pytest.mark.parametrize("distances", [(sphere_distance, sphere_distance), (plane(6.0), plane(6.0))])
def test_a_wall_seen_unmoved_moves_nothing(distances: tuple[object, object]) -> None:
    space = block("p2p1")
    points = face_points(space.nodes, space.face_nodes(faces_at(space, 2, SIZE[2])))
    wall = SlidingWall.between(points, points.positions(space.nodes), *distances, 1000.0)  # type: ignore[arg-type]
    material = Material(MOONEY_RIVLIN, mooney_rivlin_parameters(40.0, 400.0))
    found = solve_equilibrium(Assembler(space, held_below(space, (0, 1, 2)), [wall]), {1: material})
    assert found.converged and np.abs(found.u).max() == 0.0


def test_a_wall_pushes_along_its_normal_only() -> None:
    """A plane wall that came down by d presses the bar evenly and does not hinder its sideways motion."""
    space = block("p2")
    points = face_points(space.nodes, space.face_nodes(faces_at(space, 2, SIZE[2])))
    d, k, E = 0.4, 5000.0, 60.0
    wall = SlidingWall.between(points, points.positions(space.nodes), plane(6.0), plane(6.0 - d), k)  # type: ignore[arg-type]
    sideways = traction(space, faces_at(space, 2, SIZE[2]), np.array([0.0, 0.0, 0.0]))
    assembler = Assembler(space, held_below(space), [wall, sideways])
    found = solve_equilibrium(assembler, {1: without_lateral_strain(E)}, options=TIGHT)
    assert found.converged, found.reason
    top = -d / (1.0 + E / (SIZE[2] * k))
    np.testing.assert_allclose(found.u, np.outer(space.nodes[:, 2], [0.0, 0.0, top / SIZE[2]]), atol=1e-10)
    slid = found.u + [0.3, -0.2, 0.0]
    np.testing.assert_allclose(wall.gaps(slid), wall.gaps(found.u), atol=1e-12)
