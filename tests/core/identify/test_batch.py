"""Many particles: bit for bit the same for any number of workers and any order; failures are values."""

from functools import partial

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.core.fem.newton.newton import NewtonOptions
from palpate.core.fem.state import State
from palpate.core.identify.particle_batch import solve_many, tour
from palpate.core.worker.executors import make_executor
from palpate.validate.bench.halved_sphere import BOUNDS, HalvedSphere

FACTORY = partial(HalvedSphere, (2, 1, 2), "p1p1")
THETAS = np.random.default_rng(8).uniform(BOUNDS[:, 0], BOUNDS[:, 1], (22, 2))


def observed(scene, theta, found):
    return found.u[scene.observed]


@pytest.fixture(scope="module")
def alone():
    with make_executor(1) as executor:
        return solve_many(FACTORY, THETAS, executor, observed)


@pytest.mark.parametrize("workers", [2, 4])
def test_any_number_of_workers_gives_the_same_bits(alone, workers):
    with make_executor(workers) as executor:
        together = solve_many(FACTORY, THETAS, executor, observed)
    for a, b in zip(alone, together, strict=True):
        assert np.array_equal(a.theta, b.theta)
        assert a.value.tobytes() == b.value.tobytes()
        assert a.factorisations == b.factorisations


def test_a_second_run_and_another_order_give_the_same_bits(alone):
    shuffled = np.random.default_rng(0).permutation(len(THETAS))
    with make_executor(1) as executor:
        again = solve_many(FACTORY, THETAS[shuffled], executor, observed)
    for i, b in zip(shuffled, again, strict=True):
        assert alone[i].value.tobytes() == b.value.tobytes()


def test_values_are_those_of_cold_solves_and_warm_starts_save_work(alone):
    scene = FACTORY()
    cold = [scene.solve(theta) for theta in THETAS]
    for particle, found in zip(alone, cold, strict=True):
        assert particle.converged and particle.reason == ""
        assert np.abs(particle.value - found.u[scene.observed]).max() < 1e-6 * np.abs(found.u).max()
    assert sum(p.factorisations for p in alone) <= sum(f.factorisations for f in cold)


def test_a_given_state_starts_every_block(alone):
    scene = FACTORY()
    middle = scene.solve(BOUNDS.mean(axis=1))
    with make_executor(1) as executor:
        started = solve_many(FACTORY, THETAS, executor, observed, start=State(middle.u, middle.p), block=1)
    for a, b in zip(alone, started, strict=True):
        np.testing.assert_allclose(b.value, a.value, atol=1e-6 * np.abs(a.value).max())


def test_failures_are_values_with_reasons_and_spoil_no_neighbour(alone):
    thetas = np.vstack([THETAS[:4], [[np.nan, 3.0]]])
    with make_executor(1) as executor:
        some = solve_many(FACTORY, thetas, executor, observed)
        none = solve_many(
            FACTORY, THETAS[:4], executor, observed, options=NewtonOptions(max_factorisations=1, rtol=1e-15)
        )
    assert some[4].value == np.inf and some[4].reason == "a parameter is not finite"
    for a, b in zip(alone[:4], some[:4], strict=True):
        np.testing.assert_allclose(b.value, a.value, atol=1e-6 * np.abs(a.value).max())
    for particle in none:
        assert not particle.converged and particle.value == np.inf
        assert "factorisations" in particle.reason


def test_tour_visits_all_once_near_ones_first_whatever_the_order():
    line = np.array([[5.0], [0.0], [3.0], [1.0], [4.0], [2.0]])
    assert line[tour(line)].ravel().tolist() == [0, 1, 2, 3, 4, 5]
    assert sorted(tour(THETAS).tolist()) == list(range(len(THETAS)))
    shuffled = np.random.default_rng(1).permutation(len(THETAS))
    assert np.array_equal(THETAS[shuffled][tour(THETAS[shuffled])], THETAS[tour(THETAS)])
    assert len(tour(np.zeros((0, 2)))) == 0


def test_particles_of_a_wrong_shape_are_refused_and_none_is_no_work():
    with make_executor(1) as executor:
        with pytest.raises(InputError, match=r"shape \(2,\)"):
            solve_many(FACTORY, THETAS[0], executor, observed)
        assert solve_many(FACTORY, THETAS[:0], executor, observed) == []
