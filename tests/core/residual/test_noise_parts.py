"""The covariance of all that is no effect, on arrays: what each size multiplies, and what errors of two contours do together."""

from __future__ import annotations

from dataclasses import fields, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.observe.contour_errors import ContourErrors
from palpate.core.observe.contour_noise import covariance_between
from palpate.core.observe.voxel_noise import VoxelNoise
from palpate.core.residual import noise_covariance
from palpate.core.residual.image_errors import ImageErrors, ImageErrorSizes
from palpate.core.residual.noise_covariance import (
    NoiseParts,
    NoiseSizes,
    _along,
    _Contour,
    _contours,
    _floor,
    _of_marks,
    _of_modes,
    _read_twice,
    _voxels,
    organ_noise,
)
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import _of_the_model
from palpate.core.residual.remeshing import left_by_all, what_is_left

NUMBERS = NoiseModelOptions()
SIZES = NoiseSizes.of(NUMBERS)
N = 3
RNG = np.random.default_rng(11)


def _random() -> FloatArray:
    A = RNG.standard_normal((N, N))
    return np.asarray(A @ A.T)


def _parts() -> NoiseParts:
    lengths, local = len(NUMBERS.lengths_mm), len(NUMBERS.local_lengths_mm)
    image = ImageErrors(_random(), _random(), tuple(_random() for _ in range(local)))
    contour = tuple(_random() for _ in range(lengths))
    return NoiseParts(contour, _random(), _random(), _random(), _random(), _random(), image, NUMBERS)


PARTS, LEFT = _parts(), RNG.standard_normal((N, 2))


def test_the_covariance_is_the_sum_of_all_parts_by_their_squared_sizes() -> None:
    shares = (0.4, 0.3, 0.2, 0.1)
    image = ImageErrorSizes(1.5, (0.1, 0.2, 0.3, 0.4))
    sizes = replace(SIZES, per_mode=0.5, landmark=0.7, contour=1.2, shares=shares, offset=0.2, image=image)
    told = PARTS.covariance(sizes, LEFT)
    by_hand = 1.44 * sum(s * C for s, C in zip(shares, PARTS.contour, strict=True)) + 0.25 * PARTS.per_mode
    by_hand = (
        by_hand + 2.25 * PARTS.image.edge + sum(s**2 * C for s, C in zip(image.local, PARTS.image.local, strict=True))
    )
    by_hand = by_hand + PARTS.sliding + 0.49 * PARTS.marks + 0.04 * PARTS.offset + PARTS.floor + PARTS.image.alignment
    np.testing.assert_allclose(told, by_hand + LEFT @ LEFT.T)


def test_sizes_are_read_back_from_their_coefficients() -> None:
    other = SIZES.with_varying(np.arange(1.0, len(SIZES.varying) + 1.0))
    np.testing.assert_allclose(other.varying, np.arange(1.0, len(SIZES.varying) + 1.0))
    assert other.contour == pytest.approx(np.sqrt(10.0))
    assert sum(other.shares) == pytest.approx(1.0)
    kept = {f.name for f in fields(NoiseSizes)} - {"contour", "shares", "per_mode", "image"}
    assert all(getattr(other, name) == getattr(SIZES, name) for name in kept)


def test_the_medians_of_the_priors_are_the_likeliest_sizes_before_the_data_speak() -> None:
    model = PARTS.variance_model(SIZES, LEFT)
    coefficients, _ = model.coefficients(np.zeros(model.unknowns))
    np.testing.assert_allclose(coefficients, SIZES.varying)
    np.testing.assert_allclose(
        model.fixed + np.tensordot(coefficients, model.matrices, 1), PARTS.covariance(SIZES, LEFT)
    )
    spreads = [part.spread for part in model.parts]
    assert spreads == [NUMBERS.contour_prior, NUMBERS.contour_prior, NUMBERS.size_spread, NUMBERS.size_spread]


POINTS = np.array([[0.0, 0.0, 0.0], [5.0, 0.0, 0.0], [0.0, 9.0, 0.0], [3.0, 3.0, 3.0]])


def _contour(seed: int, share: float = 0.0, shaped: bool = False) -> _Contour:
    rng = np.random.default_rng(seed)
    errors = ContourErrors.sharing(POINTS, rng.uniform(0.3, 0.6, (2, len(POINTS))), share)
    shape = rng.standard_normal((N, len(POINTS))) if shaped else None
    return _Contour(errors, rng.standard_normal((N, len(POINTS))), None, shape)


@pytest.mark.parametrize("share", [0.0, 0.6])
@pytest.mark.parametrize("same_state", [True, False])
def test_errors_of_contours_are_those_of_draws(same_state: bool, share: float) -> None:
    """e at rest and f in the deformed scan, own and common, change the data by (response + shape) e - response f."""
    one, other = _contour(1, share, shaped=True), _contour(2, share)
    if same_state:
        other = one
    kernel = covariance_between(POINTS, POINTS, 1.0, 6.0)
    L, rng, count = np.linalg.cholesky(kernel + 1e-12 * np.eye(len(POINTS))), np.random.default_rng(5), 200_000
    at_rest, common = (L @ rng.standard_normal((len(POINTS), count)) for _ in range(2))
    later = [L @ rng.standard_normal((len(POINTS), count)) for _ in range(2)]
    seen = []
    for contour, own in zip((one, other), (later[0], later[0] if same_state else later[1]), strict=True):
        both = contour.errors.common
        shape = 0.0 if contour.shape is None else contour.shape
        e = contour.errors.rest[:, None] * at_rest + both[0][:, None] * common
        f = contour.errors.deformed[:, None] * own + both[1][:, None] * common
        seen.append((contour.response + shape) @ e - contour.response @ f)
    told = one.covariance(other, 6.0, same_state)
    drawn = seen[0] @ seen[1].T / count
    np.testing.assert_allclose(drawn, told, atol=0.02 * np.abs(told).max())


@pytest.mark.parametrize("shaped", [True, False])
def test_the_organ_s_own_noise_is_of_drawing_extraction_and_voxels(
    shaped: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two states; sizes that were stated as one come in squared."""
    options = replace(NUMBERS, lengths_mm=(4.0, 9.0), voxel_length_mm=1e6)
    rng = np.random.default_rng(3)
    draws = rng.standard_normal((3, 50, len(POINTS)))
    contours = [
        replace(_contour(k), voxels=VoxelNoise(POINTS, draws[0], draws[k])) for k in (1, 2)
    ]  # fmt: skip
    shapes = [rng.standard_normal((N, len(POINTS))) for _ in range(2)] if shaped else []
    monkeypatch.setattr(noise_covariance, "_organ_contour", lambda scene, data, u: contours[scene])
    vectors: Any = [SimpleNamespace(n=N, n_modes=N - 1)] * 2
    at: Any = [SimpleNamespace(scene=k, equilibrium=SimpleNamespace(u=None)) for k in range(2)]
    sizes = replace(NoiseSizes.of(options), contour=1.4, shares=(0.3, 0.7), per_mode=0.2)
    found = organ_noise(at, vectors, options, shapes)(sizes)
    if shaped:
        contours = [replace(c, shape=shape) for c, shape in zip(contours, shapes, strict=True)]
    read, rows = cast(Any, [{"organ": c} for c in contours]), [slice(0, N), slice(N, 2 * N)]
    drawn = 1.96 * (0.3 * _contours(read, rows, 4.0) + 0.7 * _contours(read, rows, 9.0))
    modes = np.kron([[1.0, 0.5], [0.5, 1.0]], np.diag([1.0] * (N - 1) + [0.0]))
    np.testing.assert_allclose(found, drawn + 0.04 * modes + _voxels(read, rows, 1e6))


def test_every_wall_s_slide_adds_to_the_covariance(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    responses = {"bladder": rng.standard_normal((N, 3)), "rectum": rng.standard_normal((N, 2))}
    points = SimpleNamespace(displacements=lambda shift: np.full((5, 3), shift))
    walls = [SimpleNamespace(name=name, rest=np.ones((5, 3)), points=points) for name in responses]
    # Slides are known by where a wall was scanned, which a stress-free mesh is not.
    motions = {name: SimpleNamespace(unknown_at=lambda x: x[0, 0]) for name in responses}
    scene: Any = SimpleNamespace(walls=walls, shift=0.25, geometry=SimpleNamespace(motions=motions))
    monkeypatch.setattr(
        noise_covariance, "slide_responses", lambda scene, force, wall, unknown: unknown * responses[wall.name]
    )
    nothing: Any = None
    found = _along(scene, cast(Any, SimpleNamespace(n=N)), nothing)
    np.testing.assert_allclose(found, 0.75**2 * sum(R @ R.T for R in responses.values()))


def test_what_images_tell_and_where_bones_are_have_errors_of_their_own() -> None:
    """Twelve data: four modes, none of landmarks, then images, then bones."""
    motion, floor = np.diag([1.0, 2.0]), np.diag(np.arange(1.0, 7.0))
    data: Any = SimpleNamespace(n=12, motion=slice(4, 6), motion_covariance=motion, bone=SimpleNamespace(floor=floor))
    expected = np.zeros((12, 12))
    expected[4:6, 4:6], expected[6:, 6:] = motion, floor
    np.testing.assert_array_equal(_floor(data), expected)
    data.bone = None
    expected[6:, 6:] = 0.0
    np.testing.assert_array_equal(_floor(data), expected)


def test_voxels_count_where_a_surface_carries_draws_of_their_errors() -> None:
    """Two states of an organ and a wall of which one state's has no draws; at rest they share their voxels, deformed they do not."""
    rng = np.random.default_rng(9)
    draws = [rng.standard_normal((2, 400, len(POINTS))) for _ in range(3)]
    rest = draws[0][0]

    def drawn(seed: int, shaped: bool = False) -> _Contour:
        return replace(_contour(seed, shaped=shaped), voxels=VoxelNoise(POINTS, rest, draws[seed][1]))

    first, second = {"organ": drawn(1, True), "wall": _contour(5)}, {"organ": drawn(2), "wall": drawn(0)}
    rows, far = [slice(0, N), slice(N, 2 * N)], 1e6
    told = _voxels(cast(Any, [first, second]), rows, far)
    at_rest, later = rest.T @ rest / 400.0, [d[1].T @ d[1] / 400.0 for d in draws]
    organ = [first["organ"], second["organ"]]
    wall = second["wall"]
    both = organ[1].at_rest @ at_rest @ organ[0].at_rest.T
    np.testing.assert_allclose(told[N:, :N], both)
    np.testing.assert_allclose(told, told.T)
    own = organ[0].at_rest @ at_rest @ organ[0].at_rest.T + organ[0].response @ later[1] @ organ[0].response.T
    np.testing.assert_allclose(told[:N, :N], own)
    other = organ[1].at_rest @ at_rest @ organ[1].at_rest.T + organ[1].response @ later[2] @ organ[1].response.T
    other += wall.at_rest @ at_rest @ wall.at_rest.T + wall.response @ later[0] @ wall.response.T
    np.testing.assert_allclose(told[N:, N:], other)
    near = _voxels(cast(Any, [first, second]), rows, 1e-3)
    np.testing.assert_allclose(near[N:, :N], organ[1].at_rest @ np.diag(np.diag(at_rest)) @ organ[0].at_rest.T)
    assert not _voxels(cast(Any, [{"organ": _contour(1)}]), rows[:1], far).any()


def test_two_states_share_the_scan_at_rest_and_nothing_else() -> None:
    one, two = {"organ": _contour(1), "wall": _contour(3)}, {"organ": _contour(2)}
    rows = [slice(0, N), slice(N, 2 * N)]
    told = _contours(cast(Any, [one, two]), rows, 6.0)
    np.testing.assert_allclose(told, told.T)
    own = one["organ"].covariance(one["organ"], 6.0, True) + one["wall"].covariance(one["wall"], 6.0, True)
    np.testing.assert_allclose(told[:N, :N], own)
    np.testing.assert_allclose(told[N:, N:], two["organ"].covariance(two["organ"], 6.0, True))
    np.testing.assert_allclose(told[N:, :N], two["organ"].covariance(one["organ"], 6.0, False))


def test_the_model_s_own_error_is_larger_where_no_better_element_could_be_solved() -> None:
    """Half of its variance is common to both states; the second one has no better element."""
    responses = [RNG.standard_normal((N, 2)) for _ in range(2)]
    gap = cast(Any, SimpleNamespace(each=[SimpleNamespace(response=R) for R in responses]))
    columns = _of_the_model(gap, [np.ones((1, N)), np.zeros((0, N))], NUMBERS)
    solved = NUMBERS.model
    unsolved = np.hypot(NUMBERS.model, NUMBERS.unsolved_mesh_mm / NUMBERS.force_typical_mm)
    first, second = solved * responses[0], unsolved * responses[1]
    told = columns @ columns.T
    np.testing.assert_allclose(told[:N, :N], first @ first.T)
    np.testing.assert_allclose(told[N:, N:], second @ second.T)
    np.testing.assert_allclose(told[:N, N:], 0.5 * first @ second.T)


def test_half_of_a_reading_s_variance_is_common_to_all_states() -> None:
    first, second = RNG.standard_normal((N, 2)), RNG.standard_normal((N, 2))
    told = _read_twice([first, second])
    np.testing.assert_allclose(told[:N, :N], first @ first.T)
    np.testing.assert_allclose(told[N:, N:], second @ second.T)
    np.testing.assert_allclose(told[:N, N:], 0.5 * first @ second.T)


def test_a_landmark_is_known_again_in_another_state_by_its_place_at_rest() -> None:
    a, b, c = [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]
    data = [SimpleNamespace(n=7, n_marks=2, marks=slice(1, 7)), SimpleNamespace(n=6, n_marks=2, marks=slice(0, 6))]
    first, second = _of_marks([np.array([a, b]), np.array([c, a])], cast(Any, data))
    assert first.shape == (7, 9) and second.shape == (6, 9)
    np.testing.assert_array_equal(first @ first.T, np.diag([0.0, *np.ones(6)]))
    together = first @ second.T
    # Row 1 + axis of the first state and row 3 + axis of the second are one landmark's.
    expected = np.zeros((7, 6))
    expected[1:4, 3:6] = np.eye(3)
    np.testing.assert_array_equal(together, expected)


def test_a_state_without_a_drawn_organ_has_no_errors_of_surface_modes() -> None:
    drawn, not_drawn = _of_modes(cast(Any, [SimpleNamespace(n=4, n_modes=2), SimpleNamespace(n=3, n_modes=0)]))
    np.testing.assert_array_equal(drawn, [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.0, 0.0]])
    np.testing.assert_array_equal(not_drawn, np.zeros((3, 2)))


def test_the_better_element_errs_by_a_share_of_what_it_changes_and_by_the_scatter_of_meshes() -> None:
    one = np.array([[1.0, 2.0, 3.0]])
    np.testing.assert_allclose(what_is_left(one, 0.3), 0.3 * one.T)
    assert what_is_left(np.zeros((0, 3)), 0.3).shape == (3, 0)
    three = RNG.standard_normal((3, N))
    told = what_is_left(three, 0.3)
    of_mean = np.cov(three.T) / 3.0
    np.testing.assert_allclose(told @ told.T, 0.09 * np.outer(three.mean(axis=0), three.mean(axis=0)) + of_mean)
    both = left_by_all([one, np.zeros((0, N)), three], 0.3)
    covariance = both @ both.T
    np.testing.assert_allclose(covariance[:3, 6:], 0.09 * np.outer(one[0], three.mean(axis=0)))
    np.testing.assert_allclose(covariance[6:, 6:], told @ told.T)
    assert not covariance[3:6].any()
