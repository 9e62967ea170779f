"""Contact with rigid surfaces and friction: derivatives, closed forms, nothing goes through."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.applications.drop.scenes import bar_impact, rebound, slope
from palpate.applications.dynamics.contact import Contact, Layer
from palpate.applications.dynamics.march import MarchOptions, march, open_ledger
from palpate.applications.dynamics.mass import STANDARD_GRAVITY, TISSUE_DENSITY
from palpate.applications.dynamics.motion import Motion
from palpate.applications.dynamics.rigid import depth, dish, plane
from palpate.applications.dynamics.system import MovingBody
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box
from palpate.core.fem.space import Space
from palpate.core.laws import MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters

LAYER = Layer(thickness=0.5, stiffness=20.0, friction=0.4, sticking=2.0)


def block(element: str = "p1p1") -> Space:
    return Space.of(box((8.0, 11.0, 6.0), (2, 3, 2), jitter=0.2, seed=2), element)


def underside(space: Space) -> np.ndarray:
    faces = space.mesh.boundary[0]
    return faces[np.abs(space.nodes[faces][:, :, 2]).max(axis=1) < 1e-9]


@pytest.mark.parametrize("element", ["p1p1", "p2p1"])
def test_a_flat_face_is_pressed_back_with_the_layers_pressure_on_its_area(element: str) -> None:
    space = block(element)
    contact = Contact(space, underside(space), plane((3.0, 40.0, -0.3), (0.0, 0.0, 1.0)), LAYER)
    force = contact.gradient(np.zeros_like(space.nodes)).sum(axis=0)
    assert force == pytest.approx([0.0, 0.0, -8.0 * 11.0 * float(LAYER.pressure(np.array(0.3)))], rel=1e-9)
    assert contact.energy(np.zeros_like(space.nodes) + [0.0, 0.0, 0.3]) == 0.0


def test_pressure_hardly_follows_the_walls_triangles() -> None:
    """A shallow dish is nearly a plane. Where two of its triangles are near both press: a little more, never less, than a plane."""
    space, flat = block(), 88.0 * float(LAYER.pressure(np.array(0.25)))
    for rings in (5, 25):
        contact = Contact(space, underside(space), dish((4.0, 5.5, -0.25), 5000.0, 60.0, rings), LAYER)
        assert 0.95 < -contact.gradient(np.zeros_like(space.nodes))[:, 2].sum() / flat < 1.5


def test_derivatives_of_contact_and_friction() -> None:
    space = block()
    wall = plane((1.0, 30.0, -0.3), (0.02, -0.01, 1.0))
    contact = Contact(space, space.mesh.boundary[0], wall, LAYER)
    rng = np.random.default_rng(3)
    u, d, h = 0.02 * rng.normal(size=space.nodes.shape), rng.normal(size=space.nodes.shape), 1e-6
    slope_along = (contact.energy(u + h * d) - contact.energy(u - h * d)) / (2 * h)
    assert slope_along == pytest.approx(float((contact.gradient(u) * d).sum()), rel=1e-6)
    assert product(contact.hessian(u), d) == pytest.approx(
        (contact.gradient(u + h * d) - contact.gradient(u - h * d)) / (2 * h), rel=1e-5, abs=1e-4
    )
    friction, v = contact.friction_at(u), 3.0 * rng.normal(size=space.nodes.shape)
    power = (friction.potential(v + h * d) - friction.potential(v - h * d)) / (2 * h)
    assert power == pytest.approx(float((friction.gradient(v) * d).sum()), rel=1e-5)
    sliding = friction.gradient(np.zeros_like(v) + [100.0, 0.0, 0.0]).sum(axis=0)
    pressed = np.linalg.norm(contact.gradient(u).sum(axis=0))
    assert np.linalg.norm(sliding) == pytest.approx(LAYER.friction * pressed, rel=1e-3)
    assert sliding[0] > 0.0  # d(dissipation)/dv: the force on the body is against the slip


def product(entries: tuple[np.ndarray, np.ndarray, np.ndarray], d: np.ndarray) -> np.ndarray:
    rows, columns, values = entries
    out = np.zeros(d.size)
    np.add.at(out, rows, values * d.ravel()[columns])
    return out.reshape(d.shape)


def test_the_way_ends_before_the_wall() -> None:
    space = block()
    contact = Contact(space, space.mesh.boundary[0], plane((0.0, 0.0, -2.0), (0.0, 0.0, 1.0)), LAYER)
    still, down = np.zeros_like(space.nodes), np.tile([0.0, 0.0, -10.0], (space.n_nodes, 1))
    assert 0.1 < contact.free_share(still, down) < 0.2
    assert contact.free_share(still, 0.19 * down) == 1.0
    assert contact.free_share(still, -down) == 1.0


def test_a_body_behind_the_wall_and_a_layer_of_nothing_are_refused() -> None:
    space = block()
    with pytest.raises(InputError, match="lies behind it, before it moves"):
        Contact(space, space.mesh.boundary[0], plane((0.0, 0.0, 1.0), (0.0, 0.0, 1.0)), LAYER)
    with pytest.raises(InputError, match="needs positive thickness"):
        Contact(space, space.mesh.boundary[0], plane((0.0, 0.0, -1.0), (0.0, 0.0, 1.0)), Layer(0.0, 1.0))


def test_a_dish_is_hollow_upwards_and_holds_its_sphere() -> None:
    wall = dish((3.0, -2.0, 7.0), 50.0, 30.0)
    assert np.linalg.norm(wall.points - [3.0, -2.0, 57.0], axis=1) == pytest.approx(np.full(len(wall.points), 50.0))
    X = wall.points[wall.faces]
    normals = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
    assert ((np.array([3.0, -2.0, 57.0]) - X.mean(axis=1)) * normals).sum(axis=1).min() > 0.0
    ends = np.sort(wall.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert (np.unique(ends, axis=0, return_counts=True)[1] == 1).sum() == 6 * 14  # the rim is all that is open
    assert depth(wall, np.array([[3.0, -2.0, 6.0], [5.0, 0.0, 20.0]])) == pytest.approx(1.0, abs=0.01)
    assert depth(wall, np.array([[3.0, -2.0, 9.0]])) == pytest.approx(-2.0, abs=0.05)
    assert depth(wall, np.array([[60.0, -2.0, 17.0]])) < 0.0  # beside the rim, not behind


def test_a_stiff_body_falls_and_comes_back_as_the_closed_form_says() -> None:
    found = rebound(dt=1e-4)
    assert abs(found["fall"]) < 1e-9
    assert abs(found["impact_speed"]) < 1e-9
    assert abs(found["rebound_height"]) < 0.01
    assert abs(found["return_time"]) < 0.01
    assert found["energy_growth"] <= 1e-3


def test_a_bar_leaves_the_wall_when_its_wave_is_back() -> None:
    found = bar_impact(cells=40)
    assert abs(found["contact_time"]) < 0.02
    assert abs(found["rebound_speed"]) < 0.02  # under 1 % from 60 cells on: `palpate validate drop`
    assert found["energy_growth"] <= 1e-3


def test_a_block_slides_down_a_slope_or_sticks() -> None:
    assert abs(slope(dt=2e-3)["slide"]) < 0.01
    assert 0.0 <= slope(friction=0.6, dt=2e-3)["way"] < 0.5 * 0.1  # creeps slower than the sticking speed


def test_a_soft_body_in_a_dish_loses_energy_at_every_step_and_goes_nowhere_through() -> None:
    mesh = box((14.0, 18.0, 12.0), (2, 3, 2), jitter=0.15, seed=5)
    space = Space.of(mesh, "p1p1")
    assembler = Assembler(space, np.ones(space.n_displacements, dtype=bool))
    assembler.set_materials({1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(8.0, bulk_modulus(8.0, 0.49)))})
    wall = dish((8.0, 8.0, -6.0), 40.0, 25.0)
    faces = mesh.boundary[0]
    contact = Contact(space, faces, wall, Layer(0.3, 40.0, 0.3, 5.0))
    body = MovingBody(assembler, TISSUE_DENSITY, (0.0, 0.0, -STANDARD_GRAVITY), 5e-4, contact)
    motion = body.at_rest()
    ledger, deepest = open_ledger(body, motion, 6.0), list[float]()

    def watch(now: Motion) -> None:
        x = space.nodes + now.u
        deepest.append(depth(wall, np.vstack([x[np.unique(faces)], x[faces].mean(axis=1)])))

    march(body, motion, 0.045, MarchOptions(1e-3), ledger, watch)
    totals = np.array([e.total for e in ledger.energies])
    assert (totals[1:] <= np.minimum.accumulate(totals)[:-1] + 1e-3 * ledger.scale).all()
    assert max(e.contact for e in ledger.energies) > 0.0  # it did arrive
    assert -0.3 < max(deepest) < 0.0
    assert totals[-1] < -0.2 * ledger.scale
