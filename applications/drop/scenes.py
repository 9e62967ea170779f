"""Bodies whose motion has a closed form: a stiff block that falls and rebounds, a bar that strikes a wall, a block on a slope."""

from __future__ import annotations

from typing import TypedDict

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from palpate.applications.dynamics.contact import Contact, Layer
from palpate.applications.dynamics.march import MarchOptions, march, open_ledger
from palpate.applications.dynamics.mass import STANDARD_GRAVITY, TISSUE_DENSITY
from palpate.applications.dynamics.motion import Motion
from palpate.applications.dynamics.rigid import plane
from palpate.applications.dynamics.system import MovingBody
from palpate.core.arrays import IntArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box
from palpate.core.fem.space import Space
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters

_STIFF = 1e5  # kPa, shear modulus of a block that counts as rigid: its waves cross it in a hundredth of a contact


class Rebound(TypedDict):
    """Relative errors of the block against its closed forms; time in the layer, ms; growth of energy relative to the fall's."""

    fall: float
    impact_speed: float
    rebound_height: float
    return_time: float
    contact_ms: float
    energy_growth: float


class BarImpact(TypedDict):
    """Relative errors of the bar against its closed forms; growth of energy."""

    contact_time: float
    rebound_speed: float
    energy_growth: float


class Slope(TypedDict):
    """Relative error of the block's way, and that way, mm; growth of energy."""

    slide: float
    way: float
    energy_growth: float


def rebound(dt: float = 5e-5, fall: float = 20.0) -> Rebound:
    """A stiff cube of 10 mm falls so far (mm) onto the layer of a floor and comes back.

    Closed forms: time and speed of the fall, return to the height it came from, and the time of the return: twice the fall and the
    passage through the layer, whose force is known. Relative errors, except where a name says otherwise.
    """
    edge, layer = 10.0, Layer(0.5, 16.0)
    body = _block((edge, edge, edge), 4, layer, -fall - layer.thickness, (0.0, 0.0, -STANDARD_GRAVITY))
    fall_time = float(np.sqrt(2.0 * fall / STANDARD_GRAVITY))
    contact_time = _passage(layer, edge**2, body.mass.total, fall)
    motion = body.at_rest()
    ledger = open_ledger(body, motion, fall)
    motion = march(body, motion, fall_time, MarchOptions(20.0 * dt), ledger)
    speed = -float(motion.v[:, 2].mean())
    fallen = -float(motion.u[:, 2].mean())
    options = MarchOptions(dt)
    motion = march(body, motion, fall_time + 1.5 * contact_time, options, ledger)
    up = float(motion.v[:, 2].mean())
    rise = -float(motion.u[:, 2].mean())
    top = up**2 / (2.0 * STANDARD_GRAVITY) - rise  # of the flight that follows, against the start
    top_time = motion.time + up / STANDARD_GRAVITY
    return {
        "fall": fallen / fall - 1.0,
        "impact_speed": speed / float(np.sqrt(2.0 * STANDARD_GRAVITY * fall)) - 1.0,
        "rebound_height": top / fall,
        "return_time": top_time / (2.0 * fall_time + contact_time) - 1.0,
        "contact_ms": 1e3 * contact_time,
        "energy_growth": ledger.largest_growth,
    }


def _passage(layer: Layer, area: float, mass: float, fall: float) -> float:
    """Seconds that a rigid block with this flat face spends in the layer."""

    def kinetic(distance: float) -> float:
        stored, _ = quad(lambda d: float(layer.pressure(np.array(d))), distance, layer.thickness)
        return mass * STANDARD_GRAVITY * (fall + layer.thickness - distance) - area * stored

    turn = brentq(kinetic, 1e-6 * layer.thickness, layer.thickness)
    # x = turn + s^2 takes the root at the turning point away.
    depth = float(np.sqrt(layer.thickness - turn))
    half, _ = quad(lambda s: 2.0 * s / np.sqrt(max(2.0 * kinetic(turn + s * s) / mass, 1e-30)), 1e-6 * depth, depth)
    return 2.0 * half


def bar_impact(cells: int = 60, speed: float = 200.0) -> BarImpact:
    """A bar of 40 mm that cannot bulge strikes a wall end on, without gravity.

    Closed form: it leaves after twice a wave's way along it, 2 L / c, as fast as it came (Saint-Venant). Relative errors.
    """
    length, width, shear = 40.0, 2.0, 500.0
    layer = Layer(0.01, 10.0)
    space = Space.of(box((width, width, length), (1, 1, cells)), "p1")
    assembler = Assembler(space, np.ones(space.n_displacements, dtype=bool))
    assembler.set_materials({1: Material(LINEAR, np.array([shear, bulk_modulus(shear, 0.0)]))})
    contact = Contact(
        space, _underside(space), plane((0.5 * width, 0.5 * width, -1.01 * layer.thickness), (0.0, 0.0, 1.0)), layer
    )
    body = MovingBody(assembler, TISSUE_DENSITY, contact=contact)
    wave = float(np.sqrt(2.0 * shear / TISSUE_DENSITY))
    expected = 2.0 * length / wave
    motion = Motion(0.0, np.zeros_like(space.nodes), np.tile([0.0, 0.0, -speed], (space.n_nodes, 1)))
    ledger, touched = open_ledger(body, motion), list[float]()

    def watch(now: Motion) -> None:
        if contact.touching(now.u):
            touched.append(now.time)

    motion = march(body, motion, 1.3 * expected, MarchOptions(0.5 * length / cells / wave), ledger, watch)
    back = float(body.momentum(motion)[2]) / body.mass.total
    return {
        "contact_time": (touched[-1] - touched[0]) / expected - 1.0,
        "rebound_speed": back / speed - 1.0,
        "energy_growth": ledger.largest_growth,
    }


def slope(angle: float = 25.0, friction: float = 0.3, dt: float = 1e-3) -> Slope:
    """A stiff block on a slope (degrees), let go at rest: it slides with g (sin - friction cos), or stays.

    slide : relative error of the way after 0.1 s, 0 for a block that should stay. way : mm.
    """
    height, layer = 5.0, Layer(0.2, 1.0, friction, 0.5)
    along, across = (STANDARD_GRAVITY * f(np.radians(angle)) for f in (np.sin, np.cos))
    wanted = TISSUE_DENSITY * across * height
    gap = brentq(lambda d: float(layer.pressure(np.array(d))) - wanted, 1e-6, layer.thickness)
    body = _block((10.0, 10.0, height), 2, layer, -gap, (float(along), 0.0, -float(across)))
    motion = body.at_rest()
    ledger = open_ledger(body, motion)
    motion = march(body, motion, 0.1, MarchOptions(dt), ledger)
    way, expected = float(motion.u[:, 0].mean()), 0.5 * max(along - friction * across, 0.0) * 0.1**2
    return {
        "slide": way / expected - 1.0 if expected > 0.0 else 0.0,
        "way": way,
        "energy_growth": ledger.largest_growth,
    }


def _underside(space: Space) -> IntArray:
    """Faces (f, 3) at z = 0 alone: nodes at an edge must not stand for area of the sides as well."""
    faces = space.mesh.boundary[0]
    return np.asarray(faces[np.abs(space.nodes[faces][:, :, 2]).max(axis=1) < 1e-9])


def _block(
    size: tuple[float, float, float], cells: int, layer: Layer, floor: float, gravity: tuple[float, float, float]
) -> MovingBody:
    space = Space.of(box(size, (cells, cells, cells)), "p1p1")
    assembler = Assembler(space, np.ones(space.n_displacements, dtype=bool))
    assembler.set_materials({1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(_STIFF, bulk_modulus(_STIFF, 0.3)))})
    # Beside the middle of the floor's one triangle: symmetry must not hide an error.
    wall = plane((-30.0, 20.0, floor), (0.0, 0.0, 1.0))
    return MovingBody(assembler, TISSUE_DENSITY, gravity, contact=Contact(space, _underside(space), wall, layer))
