"""The reduced model against full solves it never saw, and its interpolation against theorems."""

import time

import numpy as np
import pytest

from palpate.core.errors import ConvergenceError, InputError
from palpate.core.reduced import kernel_interpolation
from palpate.core.reduced.greedy_design import ReducedOptions, Snapshot
from palpate.core.reduced.kernel_interpolation import Features, best_fit, fit
from palpate.core.reduced.reduced_model import ReducedModel, scene_hash
from palpate.validate.bench.halved_sphere import BOUNDS, HalvedSphere

UNSEEN = 200


@pytest.fixture(scope="module")
def scene():
    return HalvedSphere()


def snapshots(scene, thetas, slopes=True):
    out = []
    for theta in thetas:
        found = scene.solve(theta)
        assert found.converged
        du = scene.sensitivities(theta, found)[:, scene.observed] if slopes else None
        out.append(Snapshot(found.u[scene.observed], du))
    return out


@pytest.fixture(scope="module")
def model(scene):
    return ReducedModel.build(lambda thetas: snapshots(scene, thetas), BOUNDS, "scene")


@pytest.fixture(scope="module")
def unseen(scene):
    thetas = np.random.default_rng(11).uniform(BOUNDS[:, 0], BOUNDS[:, 1], (UNSEEN, 2))
    corners = np.array(np.meshgrid(*BOUNDS)).reshape(2, -1).T  # where interpolation is worst
    thetas[:4] = corners
    return thetas, np.array([s.displacement for s in snapshots(scene, thetas, slopes=False)])


def errors(model, unseen):
    thetas, u = unseen
    return np.linalg.norm(model.evaluate(thetas) - u, axis=2).max(axis=1)


def test_unseen_particles_are_within_a_thousandth_of_the_largest_displacement(model, unseen):
    smallest = np.linalg.norm(unseen[1], axis=2).max(axis=1).min()
    assert errors(model, unseen).max() <= 1e-3 * smallest
    assert model.solves <= 60


def test_estimate_is_never_less_than_half_the_error_and_not_absurdly_large(model, unseen):
    ratio = model.error_estimate(unseen[0]) / errors(model, unseen)
    assert ratio.min() >= 0.5
    assert np.median(ratio) <= 50.0
    assert model.worst_estimate <= 1e-3 * model.scale


def test_a_coarse_model_knows_that_it_is_coarse(scene, unseen):
    coarse = ReducedModel.build(
        lambda t: snapshots(scene, t), BOUNDS, "scene", ReducedOptions(tolerance=1e-6, max_snapshots=8)
    )
    error = errors(coarse, unseen)
    assert coarse.solves == 8
    assert error.max() > 1e-3 * coarse.scale  # else this test shows nothing
    assert (coarse.error_estimate(unseen[0]) / error).min() >= 0.5
    wrong = error > 1e-3 * coarse.scale
    assert (coarse.error_estimate(unseen[0])[wrong] > 1e-3 * coarse.scale).all()


def test_values_alone_do_it_too_with_more_solves(scene, model, unseen):
    plain = ReducedModel.build(lambda t: snapshots(scene, t, slopes=False), BOUNDS, "scene")
    assert errors(plain, unseen).max() <= 1e-3 * plain.scale
    assert plain.solves > model.solves


def test_evaluation_takes_less_than_a_millisecond(model):
    theta = BOUNDS.mean(axis=1)
    seconds = []
    for _ in range(200):
        start = time.perf_counter()
        model.evaluate(theta)
        seconds.append(time.perf_counter() - start)
    assert np.median(seconds) < 1e-3


def test_gradient_is_the_derivative_of_the_model_and_of_the_scene(scene, model):
    theta, h = np.log([23.0, 140.0]), 1e-4
    g = model.gradient(theta)
    for k, e in enumerate(np.eye(2)):
        difference = (model.evaluate(theta + h * e) - model.evaluate(theta - h * e)) / (2 * h)
        np.testing.assert_allclose(g[k], difference, atol=1e-7 * np.abs(g).max())
    truth = snapshots(scene, [theta])[0].sensitivities
    assert np.abs(g - truth).max() <= 0.01 * np.abs(truth).max()


def test_one_and_many_particles_agree(model):
    thetas = BOUNDS.mean(axis=1) + np.array([[0.0, 0.3], [-1.0, 2.0], [0.5, 0.5]])
    many, slopes = model.evaluate(thetas), model.gradient(thetas)
    assert many.shape == (3, model.n_points, 3) and slopes.shape == (3, 2, model.n_points, 3)
    for k, theta in enumerate(thetas):
        np.testing.assert_allclose(model.evaluate(theta), many[k], atol=1e-12)
        np.testing.assert_allclose(model.gradient(theta), slopes[k], atol=1e-12)
        assert model.error_estimate(theta) == pytest.approx(model.error_estimate(thetas)[k], rel=1e-6)


def test_outside_the_box_it_is_not_to_be_trusted(model):
    outside = np.array([BOUNDS[0, 1] + 0.01, BOUNDS[1].mean()])
    assert model.error_estimate(outside) == np.inf
    assert model.error_estimate(BOUNDS.mean(axis=1)) < model.tolerance * model.scale


def test_saved_model_is_the_same_and_goes_stale_with_its_scene(model, tmp_path):
    path = tmp_path / "reduced.npz"
    model.save(path)
    back = ReducedModel.load(path, "scene")
    theta = np.log([11.0, 70.0])
    assert np.array_equal(back.evaluate(theta), model.evaluate(theta))
    assert back.error_estimate(theta) == model.error_estimate(theta)
    assert ReducedModel.load(path, "another scene") is None
    path.write_bytes(path.read_bytes()[:1000])
    assert ReducedModel.load(path, "scene") is None
    assert ReducedModel.load(tmp_path / "none.npz", "scene") is None


def test_scene_hash_tells_values_types_and_order_apart():
    a, b = np.arange(4.0), np.arange(4)
    hashes = [scene_hash(a, "p1"), scene_hash(b, "p1"), scene_hash("p1", a), scene_hash(a.reshape(2, 2), "p1")]
    hashes += [scene_hash(a, "p1", 1.0), scene_hash(a, "p1", "1.0"), scene_hash(a[::-1], "p1")]
    assert len(set(hashes)) == len(hashes)
    assert scene_hash(a, "p1") == scene_hash(a.copy(), "p1")


def smooth(theta):
    """A made-up response with the poles of a stiff inclusion: (n, 3) for theta (2,)."""
    soft = 1.0 / (1.0 + np.exp(theta - 3.4))
    p = np.linspace(0.0, 1.0, 7)[:, None]
    return 5.0 * np.hstack([p * soft[0], (1.0 - p) * soft[1] ** 2, p * (1.0 - p) * soft[0] * soft[1] + 0.2])


def test_where_there_is_no_equilibrium_it_asks_for_a_full_solve_and_elsewhere_it_holds():
    def solve(thetas):
        return [None if t.min() > np.log(250.0) else Snapshot(smooth(t)) for t in thetas]

    model = ReducedModel.build(solve, BOUNDS, "", ReducedOptions(max_snapshots=120))
    assert model.failed > 0
    assert model.error_estimate(BOUNDS[:, 1]) > model.tolerance * model.scale
    thetas = np.random.default_rng(3).uniform(BOUNDS[:, 0], np.log(200.0), (100, 2))
    error = np.linalg.norm(model.evaluate(thetas) - np.array([smooth(t) for t in thetas]), axis=2).max(axis=1)
    assert error.max() <= 1e-3 * model.scale


def test_scenes_without_equilibria_and_bounds_without_a_box_are_refused():
    with pytest.raises(ConvergenceError, match=r"12 of 12 .* narrow the bounds"):
        ReducedModel.build(lambda thetas: [None] * len(thetas), BOUNDS, "")
    with pytest.raises(InputError, match="are not a box"):
        ReducedModel.build(lambda thetas: [], BOUNDS[:, ::-1], "")


def test_features_are_chebyshev_products_and_their_derivatives():
    features = Features.enough_for(3, 200, 2.0)
    x = np.random.default_rng(0).uniform(-1, 1, (5, 3))
    T = [np.polynomial.chebyshev.chebvander(x[:, i], features.powers.max()) for i in range(3)]
    product = np.prod([T[i][:, features.powers[:, i]] for i in range(3)], axis=0)
    np.testing.assert_allclose(features.values(x), product * 2.0 ** -features.powers.sum(axis=1), atol=1e-14)
    for i, e in enumerate(np.eye(3)):
        difference = (features.values(x + 1e-6 * e) - features.values(x - 1e-6 * e)) / 2e-6
        np.testing.assert_allclose(features.gradients(x)[:, i], difference, atol=1e-8)


def test_leave_one_out_formula_is_leaving_one_out():
    rng = np.random.default_rng(1)
    x, data = rng.uniform(-1, 1, (14, 2)), rng.normal(size=(14, 3, 4))
    whole = fit(x, data, 2.0)
    for i in (0, 5, 13):
        others = np.delete(np.arange(14), i)
        part = fit(x[others], data[others], 2.0)
        predicted = part.features.values(x[i : i + 1]) @ part.coefficients
        np.testing.assert_allclose(whole.left_out[i], predicted[0] - data[i, 0], rtol=1e-4, atol=1e-4)
        assert whole.left_out_power[i] == pytest.approx(part.power(x[i : i + 1])[0], rel=1e-3)


def test_interpolant_meets_its_data_and_power_function_bounds_any_function_of_norm_one():
    rng = np.random.default_rng(2)
    x = rng.uniform(-1, 1, (20, 2))
    features = Features.enough_for(2, 60, 2.0)
    c = rng.normal(size=(len(features.powers), 30))
    c /= np.linalg.norm(c, axis=0)  # thirty functions of the space, each of norm one
    data = np.stack([features.rows(point[None], True)[0] @ c for point in x])
    found = fit(x, data, 2.0)
    np.testing.assert_allclose(features.rows(x, True) @ found.coefficients, data, atol=3e-5)  # the root of the noise
    assert found.power(x).max() < 1e-3
    new = rng.uniform(-1, 1, (300, 2))
    error = np.abs(features.values(new) @ (found.coefficients - c)).max(axis=1)
    assert (error <= found.power(new)).all()
    assert (error / found.power(new)).max() > 0.1  # a bound, and not a void one


def test_decay_is_found_from_the_data():
    x = np.random.default_rng(4).uniform(-1, 1, (40, 1))
    for pole, rho in ((0.5, 1.618), (1.366, 3.06)):  # 1 / (x^2 + pole^2) has its ellipse at pole + sqrt(1 + pole^2)
        data = 1.0 / (x[:12, :, None] ** 2 + pole**2)
        found = best_fit(x[:12], data)
        assert abs(np.log(found.features.rho / rho)) < 0.5
    assert kernel_interpolation.RHOS[0] < 1.618
