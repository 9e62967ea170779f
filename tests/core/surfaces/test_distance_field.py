"""The interpolated signed distance: accuracy, exact derivatives, continuation, open surfaces."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from triangle_shapes import icosphere, tube

from palpate.core.errors import InputError
from palpate.core.surfaces.distance_field import SignedDistanceField, signed_distance
from palpate.core.surfaces.triangle_tree import TriangleTree

SEMI_AXES = np.array([14.0, 18.0, 22.0])
CENTRE = np.array([-30.3, 211.7, 48.9])


def ellipsoid_distance(x, semi_axes):
    """Signed distance from a centred ellipsoid: the foot is a^2 x / (a^2 + t) with t the root of a monotone function."""
    low, high = np.full(len(x), -(semi_axes.min() ** 2) + 1e-9), np.full(len(x), 1e5)
    for _ in range(200):
        t = 0.5 * (low + high)
        above = ((semi_axes * x / (semi_axes**2 + t[:, None])) ** 2).sum(axis=1) > 1
        low, high = np.where(above, t, low), np.where(above, high, t)
    foot = semi_axes**2 * x / (semi_axes**2 + t[:, None])
    outside = ((x / semi_axes) ** 2).sum(axis=1) > 1
    return np.where(outside, 1, -1) * np.linalg.norm(x - foot, axis=1)


@pytest.fixture(scope="module")
def ellipsoid():
    points, faces = icosphere(5, SEMI_AXES, CENTRE)
    return SignedDistanceField.from_surface(points, faces)


def test_sphere_is_right_within_a_fiftieth_of_a_millimetre():
    field = SignedDistanceField.from_surface(*icosphere(5, (20, 20, 20)), spacing_mm=1.0)
    direction = np.random.default_rng(0).normal(size=(5000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    radius = np.random.default_rng(1).uniform(15, 25, 5000)
    d, normal = field.value_and_gradient(direction * radius[:, None])
    assert np.abs(d - (radius - 20)).max() < 0.02
    assert np.abs(normal - direction).max() < 0.02


def test_ellipsoid_off_centre_is_right_within_a_fiftieth_of_a_millimetre(ellipsoid):
    x = np.random.default_rng(2).uniform(-SEMI_AXES - 6, SEMI_AXES + 6, (20_000, 3))
    expected = ellipsoid_distance(x, SEMI_AXES)
    d = ellipsoid.value_and_gradient(x + CENTRE)[0]
    near = np.abs(expected) < 5.0
    assert near.sum() > 5000
    assert np.abs(d - expected)[near].max() < 0.02
    assert np.abs(d - expected)[expected > 0].max() < 0.05


def test_gradient_and_hessian_are_the_derivatives_of_the_value(ellipsoid):
    """Inside the grid, at its faces' neighbourhood and far beyond it alike. d is O(10): 1e-7 is what differences can see."""
    x = CENTRE + np.random.default_rng(3).uniform(-60, 60, (2000, 3))
    _, gradient = ellipsoid.value_and_gradient(x)
    hessian, h = ellipsoid.hessian(x), 1e-4
    for k, step in enumerate(np.eye(3) * h):
        (up, g_up), (down, g_down) = ellipsoid.value_and_gradient(x + step), ellipsoid.value_and_gradient(x - step)
        np.testing.assert_allclose((up - down) / (2 * h), gradient[:, k], atol=1e-7)
        np.testing.assert_allclose((g_up - g_down) / (2 * h), hessian[:, :, k], atol=1e-7)
    np.testing.assert_array_equal(hessian, hessian.transpose(0, 2, 1))


def test_second_derivatives_are_continuous_across_cells_and_the_grid_faces(ellipsoid):
    """The third derivative of a distance sampled at 1 mm stays below 2 / mm2, so 1e-9 mm can change d'' by 1e-8 at most."""
    rng = np.random.default_rng(4)
    size = np.array(ellipsoid.coefficients.shape) - 3
    node = rng.integers(1, size, (500, 3)) + np.where(np.arange(3) == 1, 0.0, 0.37)
    node[:100, 1] = 0.0
    x = ellipsoid.origin + node
    for step in ([0.0, 1e-9, 0.0],):
        np.testing.assert_allclose(ellipsoid.hessian(x + step), ellipsoid.hessian(x - np.array(step)), atol=1e-8)


def test_beyond_the_grid_the_distance_goes_on_growing(ellipsoid):
    direction = np.random.default_rng(5).normal(size=(300, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    d, gradient = ellipsoid.value_and_gradient(CENTRE + 45.0 * direction)
    true = ellipsoid_distance(45.0 * direction, SEMI_AXES)
    assert np.abs(d / true - 1).max() < 0.15
    assert np.einsum("qi,qi->q", gradient, direction).min() > 0.8


def test_a_linear_field_is_reproduced_everywhere():
    i, j, k = np.meshgrid(np.arange(7), np.arange(5), np.arange(6), indexing="ij")
    field = SignedDistanceField.from_samples(2.0 + 0.6 * i - 0.5 * j + 0.3 * k, np.array([1.0, -2.0, 3.0]), 0.5)
    x = np.random.default_rng(6).uniform(-20, 20, (200, 3))
    d, gradient = field.value_and_gradient(x)
    np.testing.assert_allclose(d, 2.0 + (x - [1, -2, 3]) @ [1.2, -1.0, 0.6], atol=1e-12)
    np.testing.assert_allclose(gradient, np.tile([1.2, -1.0, 0.6], (200, 1)), atol=1e-12)


def test_samples_are_interpolated():
    samples = np.random.default_rng(7).normal(size=(6, 9, 4))
    field = SignedDistanceField.from_samples(samples, np.zeros(3), 2.0)
    x = 2.0 * np.argwhere(np.ones(samples.shape))
    np.testing.assert_allclose(field.value_and_gradient(x)[0], samples.ravel(), atol=1e-12)


def test_an_open_tube_goes_on_beyond_its_rim_without_a_jump():
    """Closest-point signs jump from -8 to 8 mm there; the tube's wall nodes would be torn apart."""
    field = SignedDistanceField.from_surface(*tube(10.0, 40.0, 96, 30))
    rng = np.random.default_rng(8)
    angle, z, r = rng.uniform(0, 2 * np.pi, 2000), rng.uniform(-8, 48, 2000), rng.uniform(6, 15, 2000)
    d, gradient = field.value_and_gradient(np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1))
    assert np.abs(d - (r - 10)).max() < 0.05
    assert np.abs(gradient[:, 2]).max() < 0.03


def test_far_grid_values_that_were_interpolated_stay_close_to_exact():
    points, faces = icosphere(4, SEMI_AXES)
    near, everywhere = (SignedDistanceField.from_surface(points, faces, band_mm=b) for b in (5.0, 1e3))
    x = np.random.default_rng(9).uniform(-SEMI_AXES - 11, SEMI_AXES + 11, (5000, 3))
    a, b = near.value_and_gradient(x)[0], everywhere.value_and_gradient(x)[0]
    assert np.abs(a - b)[np.abs(b) < 4.0].max() < 2e-3
    assert np.abs(a - b)[b > 0].max() < 0.03


def test_box_chooses_the_grid():
    box = np.array([[-3.0, -4.0, -5.0], [9.0, 8.0, 7.0]])
    field = SignedDistanceField.from_surface(*icosphere(2, (6, 6, 6)), box=box)
    np.testing.assert_array_equal(field.origin, box[0])
    assert field.coefficients.shape == (15, 15, 15)


def test_arrays_round_trip_without_pickle(ellipsoid, tmp_path):
    np.savez(tmp_path / "field.npz", **ellipsoid.arrays())
    with np.load(tmp_path / "field.npz", allow_pickle=False) as data:
        again = SignedDistanceField.from_arrays(data)
    x = CENTRE + np.random.default_rng(10).uniform(-40, 40, (100, 3))
    np.testing.assert_array_equal(again.hessian(x), ellipsoid.hessian(x))


def test_threads_share_a_field(ellipsoid):
    x = CENTRE + np.random.default_rng(11).uniform(-40, 40, (8, 4000, 3))
    alone = [ellipsoid.value_and_gradient(part)[0] for part in x]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda part: ellipsoid.value_and_gradient(part)[0], x))
    np.testing.assert_array_equal(alone, together)


def test_not_a_number_gives_not_a_number(ellipsoid):
    x = np.array([[np.nan, 0, 0], [np.inf, 0, 0], CENTRE])
    d, gradient = ellipsoid.value_and_gradient(x)
    assert np.isnan(d).tolist() == [True, True, False]
    assert np.isnan(gradient[:2]).all()
    assert np.isnan(ellipsoid.hessian(x)[:2]).all()


def test_a_grid_too_large_for_memory_is_refused():
    with pytest.raises(InputError, match=r"too large for a 0\.05 mm distance grid"):
        SignedDistanceField.from_surface(*icosphere(1, (40, 40, 40)), spacing_mm=0.05)


def test_signed_distance_of_a_closed_surface_is_positive_outside():
    tree = TriangleTree.of(*icosphere(3, (5, 6, 7)))
    assert signed_distance(tree, np.zeros((1, 3)))[0] < -4.9
    assert signed_distance(tree, np.array([[0, 0, 9.0]]))[0] > 1.9
