"""Motion without contact: mass, momentum, order of the time steps, energy, damping."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from palpate.applications.dynamics.march import MarchOptions, march, open_ledger
from palpate.applications.dynamics.mass import KG_MM3, STANDARD_GRAVITY, Mass
from palpate.applications.dynamics.motion import Motion
from palpate.applications.dynamics.schemes import take_step
from palpate.applications.dynamics.system import MovingBody
from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError, InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.meshes import box
from palpate.core.fem.space import Space
from palpate.core.laws import LINEAR, MOONEY_RIVLIN, bulk_modulus, mooney_rivlin_parameters

SIZE = np.array([12.0, 20.0, 9.0])
DENSITY = 1050.0 * KG_MM3
G = 15.0  # kPa


def organ(
    element: str = "p1p1", clamped: bool = False, damping: float = 0.0, gravity: float = 0.0, nu: float = 0.49
) -> MovingBody:
    """An irregular block, free or held at its low-x face."""
    space = Space.of(box(SIZE, (2, 3, 2), jitter=0.2, seed=4), element)
    free = np.ones(space.n_displacements, dtype=bool)
    if clamped:
        free = np.repeat(space.nodes[:, 0] > 1e-9, 3)
    assembler = Assembler(space, free)
    assembler.set_materials({1: Material(MOONEY_RIVLIN, mooney_rivlin_parameters(G, bulk_modulus(G, nu)))})
    return MovingBody(assembler, DENSITY, (0.0, 0.0, -gravity), damping)


def angular_momentum(body: MovingBody, motion: Motion) -> FloatArray:
    """(3,) mN mm s, about the origin."""
    x = body.assembler.space.nodes + motion.u
    return np.asarray(np.cross(x, body.mass.times(motion.v)).sum(axis=0))


def struck(body: MovingBody, speed: float) -> Motion:
    """Moving up at its far end: a start for vibrations of the held block."""
    X = body.assembler.space.nodes
    v = np.zeros_like(X)
    v[:, 2] = speed * (X[:, 0] / SIZE[0]) ** 2
    return Motion(0.0, np.zeros_like(X), v)


def spinning(body: MovingBody, speed: float) -> Motion:
    """Turning about a skew axis through its centre, and moving, without deformation."""
    X = body.assembler.space.nodes
    axis = np.array([0.3, -0.5, 0.8]) * speed
    v = np.cross(axis, X - body.centre(body.at_rest())) + np.array([30.0, -20.0, 10.0])
    return Motion(0.0, np.zeros_like(X), v)


@pytest.mark.parametrize("element", ["p1", "p2"])
def test_mass_is_the_density_times_volume_and_its_moments_are_the_blocks(element: str) -> None:
    space = Space.of(box(SIZE, (2, 3, 2), jitter=0.2, seed=4), element)
    mass = Mass.of(space, DENSITY)
    assert mass.total == pytest.approx(DENSITY * SIZE.prod(), rel=1e-12)
    X = space.nodes
    for i, j in ((0, 0), (1, 1), (0, 2)):  # of quadratics exact: both elements hold x and y
        moment = SIZE[i] ** 2 / 3.0 if i == j else SIZE[i] * SIZE[j] / 4.0
        assert X[:, i] @ mass.times(X)[:, j] == pytest.approx(mass.total * moment, rel=1e-12)


def test_units_a_litre_of_water_weighs_a_kilogram_and_hangs_with_ten_newton() -> None:
    space = Space.of(box((100.0, 100.0, 100.0), (1, 1, 1)), "p1")
    assembler = Assembler(space, np.ones(space.n_displacements, dtype=bool))
    assembler.set_materials({1: Material(LINEAR, np.array([10.0, 100.0]))})
    body = MovingBody(assembler, 1000.0 * KG_MM3, (0.0, 0.0, -STANDARD_GRAVITY))
    assert body.mass.total == pytest.approx(1.0)
    assert body.weight.sum(axis=0) == pytest.approx([0.0, 0.0, -9806.65])  # mN
    moving = Motion(0.0, np.zeros_like(space.nodes), np.full_like(space.nodes, 1000.0))
    assert body.energies(moving).kinetic * 1e-6 == pytest.approx(1.5)  # J of 1 kg at sqrt(3) m/s


def test_a_region_without_a_density_is_refused() -> None:
    space = Space.of(box(SIZE, (1, 1, 1)), "p1")
    with pytest.raises(InputError, match=r"regions \[1\] of the mesh have no density"):
        Mass.of(space, {2: DENSITY})
    with pytest.raises(InputError, match="density of region 1 is 0"):
        Mass.of(space, 0.0)


def test_free_fall_is_exact() -> None:
    body = organ(gravity=STANDARD_GRAVITY)
    end = march(body, body.at_rest(), 0.05, MarchOptions(dt=4e-3))
    assert end.u[:, 2] == pytest.approx(np.full(len(end.u), -0.5 * STANDARD_GRAVITY * 0.05**2), rel=1e-9)
    assert end.v[:, 2] == pytest.approx(np.full(len(end.v), -STANDARD_GRAVITY * 0.05), rel=1e-9)


@pytest.mark.parametrize(("scheme", "order"), [("sdirk2", 2.0), ("backward-euler", 1.0)])
@pytest.mark.parametrize("damping", [0.0, 2e-4])
def test_order_of_the_time_steps(scheme: str, order: float, damping: float) -> None:
    """A spinning, vibrating free block: large rotations, so that damping's own order shows as well."""
    body = organ("p1", damping=damping, nu=0.2)
    X = body.assembler.space.nodes
    start = spinning(body, 40.0)
    start = Motion(0.0, 0.02 * (X - X.mean(axis=0)) * [1.0, -1.0, 0.5], start.v)
    ends = []
    for steps in (32, 64, 128):
        motion = start
        for _ in range(steps):
            step = take_step(body, motion, 4e-4 / steps, 1e-9, scheme=scheme)
            assert step.motion is not None
            motion = step.motion
        ends.append(motion.u)
    coarse, fine = (float(np.linalg.norm(a - b)) for a, b in pairwise(ends))
    assert np.log2(coarse / fine) == pytest.approx(order, abs=0.15)


def test_momentum_is_kept_and_angular_momentum_to_the_order_of_the_step() -> None:
    body = organ()
    start = spinning(body, 30.0)
    off = []
    for dt in (1e-3, 5e-4):
        end = march(body, start, 0.02, MarchOptions(dt=dt))
        assert body.momentum(end) == pytest.approx(body.momentum(start), rel=1e-6)
        off.append(float(np.linalg.norm(angular_momentum(body, end) - angular_momentum(body, start))))
    assert off[1] < 2e-3 * float(np.linalg.norm(angular_momentum(body, start)))
    assert off[0] > 3.0 * off[1]


@pytest.mark.parametrize("element", ["p1p1", "p2p0"])
def test_energy_never_grows_and_goes_where_the_books_say(element: str) -> None:
    free, damped = (organ(element, clamped=True, damping=d) for d in (0.0, 1e-3))
    for body in (free, damped):
        motion = struck(body, 400.0)
        ledger = open_ledger(body, motion)
        march(body, motion, 0.015, MarchOptions(dt=2.5e-4), ledger)
        totals = np.array([e.total for e in ledger.energies])
        assert np.diff(totals).max() <= 1e-6 * ledger.scale
        assert ledger.viscous == 0.0 if body is free else ledger.viscous > 0.3 * ledger.scale
        assert abs(ledger.unaccounted) < 0.06
        assert max(e.kinetic for e in ledger.energies) > 0.3 * totals[0]  # it does swing


def test_damping_brakes_a_mode_as_it_should_and_a_turn_not_at_all() -> None:
    beta = 4e-4
    body = organ("p1", clamped=True, damping=beta)
    motion = struck(body, 2.0)
    ledger = open_ledger(body, motion)
    march(body, motion, 0.03, MarchOptions(dt=1e-4), ledger)
    times, kinetic = np.array(ledger.times), np.array([e.kinetic for e in ledger.energies])
    peaks = 1 + np.flatnonzero((kinetic[1:-1] > kinetic[:-2]) & (kinetic[1:-1] >= kinetic[2:]))[2:]
    w = np.pi / np.diff(times[peaks]).mean()  # two peaks of kinetic energy a period
    rate = -np.polyfit(times[peaks], np.log(kinetic[peaks]), 1)[0]
    # Energy falls by exp(-2 zeta w t), zeta = beta w / 2, where all deformation is shear; some of it is not.
    assert 0.85 < rate / (beta * w**2) < 1.02
    free = organ("p1", damping=beta)
    ledger = open_ledger(free, spinning(free, 20.0))
    march(free, spinning(free, 20.0), 0.03, MarchOptions(dt=5e-4), ledger)
    assert ledger.viscous < 2e-3 * ledger.scale


def test_a_step_that_makes_energy_is_taken_again_in_halves_and_given_up_at_last() -> None:
    body = organ(clamped=True)
    motion = struck(body, 400.0)
    ledger = open_ledger(body, motion)
    with pytest.raises(ConvergenceError, match=r"stops at 0\.0 ms: the energy grows"):
        march(body, motion, 0.01, MarchOptions(dt=1e-3, energy_tolerance=-0.5), ledger)
    assert ledger.rejected > 10
