"""Local matching against motions that are known: errors, what it says of them, and what it must not see."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from palpate.imaging.matching.local_matching import LocalMatches, MatchOptions, match
from palpate.imaging.matching.noise import measured_correlation
from palpate.imaging.matching.window_errors import one_step, precision_of_step
from palpate.imaging.volume import Volume

SPACING, SHAPE = np.array([1.2, 1.2, 2.5]), (56, 56, 26)
GRID = np.diag([*SPACING, 1.0])
PLACES = np.moveaxis(np.indices(SHAPE), 0, -1) * SPACING
ALL = np.ones(SHAPE, dtype=bool)
# Median size of a standard normal number.
NORMAL_MEDIAN = 0.6745


def texture(seed: int) -> np.ndarray:
    """Lobules of soft tissue in fat."""
    random = np.random.default_rng(seed)
    field = ndimage.gaussian_filter(random.standard_normal(SHAPE), 4.0 / SPACING)
    return ndimage.gaussian_filter(np.where(field > 0.3 * field.std(), 40.0, -90.0), 0.9 / SPACING)


def motion(points: np.ndarray) -> np.ndarray:
    near = np.exp(-((points - PLACES.reshape(-1, 3).mean(axis=0)) ** 2).sum(axis=-1) / (2.0 * 22.0**2))
    return near[..., None] * np.array([1.0, -4.0, 1.5])


def noise(seed: int, sd: float) -> np.ndarray:
    made = ndimage.gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), (0.6, 0.6, 0.2))
    return made * (sd / made.std())


def pair(sd: float = 15.0) -> tuple[Volume, Volume]:
    """The second state as the scanner sees it, asked at the places of the first: first(x) = second(x + u(x))."""
    base = texture(1)
    first = ndimage.map_coordinates(base, ((PLACES + motion(PLACES)) / SPACING).transpose(3, 0, 1, 2), order=3)
    return Volume(first + noise(2, sd), GRID), Volume(base + noise(3, sd), GRID)


def inner(found: LocalMatches) -> np.ndarray:
    ends = (np.array(SHAPE) - 1) * SPACING
    return np.asarray(((found.points > 8.0) & (found.points < ends - 8.0)).all(axis=1))


def along_axes(found: LocalMatches, error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Errors (n, 3) along the eigenvectors of the precision, and their stated standard deviations, mm."""
    information, axes = np.linalg.eigh(found.precision)
    return np.einsum("nki,nk->ni", axes, error), 1.0 / np.sqrt(np.maximum(information, 1e-12))


def least_covariance(points: np.ndarray, sd: float) -> np.ndarray:
    """Covariance (n, 3, 3) mm2 that noise of a known size and correlation leaves in windows about the points when the
    picture without noise is known: A^-1 M A^-1 with its own gradient (Lucas and Kanade 1981), brightness left out."""
    options = MatchOptions()
    smoothing = options.levels[-1].smoothing_mm / SPACING
    at = ((PLACES + motion(PLACES)) / SPACING).transpose(3, 0, 1, 2)
    clean = ndimage.gaussian_filter(ndimage.map_coordinates(texture(1), at, order=3), smoothing)
    gradient = np.stack(np.gradient(clean, *SPACING), axis=-1)
    variance = 2.0 * ndimage.gaussian_filter(noise(2, sd), smoothing).var()
    together = np.sqrt(2.0 * (np.array([0.6, 0.6, 0.2]) ** 2 + smoothing**2))  # voxels, of the noise's correlation
    size = np.prod(np.sqrt(2.0 * np.pi) * together)
    out = []
    for point in points:
        w = np.exp(-0.5 * ((PLACES - point) ** 2).sum(axis=-1) / options.window_mm**2)
        g = gradient - (w[..., None] * gradient).sum(axis=(0, 1, 2)) / w.sum()
        spread = np.stack([ndimage.gaussian_filter(w * g[..., a], together) for a in range(3)], axis=-1) * size
        A = np.einsum("xyz,xyzi,xyzj->ij", w, g, g)
        M = variance * np.einsum("xyz,xyzi,xyzj->ij", w, g, spread)
        out.append(np.linalg.solve(A, np.linalg.solve(A, M).T))
    return np.array(out)


def test_errors_are_hardly_larger_than_the_noise_in_a_window_leaves_them() -> None:
    """A small window holds little. What it errs by is told by the picture without noise and by the noise alone; the matcher
    knows the picture with noise only."""
    first, second = pair()
    found = match(first, second, (ALL, ALL), motion)
    here = inner(found)
    error, least = (found.displacement - motion(found.points))[here], least_covariance(found.points[here], 15.0)
    value, axes = np.linalg.eigh(least)
    z = np.einsum("nki,nk->ni", axes, error) / np.sqrt(value)
    assert np.median(np.abs(z)) < 1.2 * NORMAL_MEDIAN
    assert np.sqrt((error**2).mean()) < 1.4 * np.sqrt(value.mean())


def test_a_known_motion_is_found_and_its_error_is_the_one_that_is_stated() -> None:
    first, second = pair()
    off = np.array([0.8, -0.6, 0.9])
    found = match(first, second, (ALL, ALL), lambda points: motion(points) + off)
    here = inner(found)
    error = (found.displacement - motion(found.points))[here]
    assert np.sqrt((error**2).mean()) < 1.4 * np.sqrt(
        np.linalg.eigvalsh(least_covariance(found.points[here], 15.0)).mean()
    )
    along, stated = along_axes(found, found.displacement - motion(found.points))
    told = here[:, None] & (stated < 0.6)
    assert told.mean() > 0.3
    assert 0.7 < np.sqrt(((along / stated)[told] ** 2).mean()) < 1.4
    np.testing.assert_allclose(found.shift, found.displacement - motion(found.points) - off, atol=0.2)


def test_a_scan_against_itself_has_not_moved() -> None:
    """Null test: the same body twice, each with noise of its own."""
    base = texture(4)
    states = [Volume(base + noise(seed, 12.0), GRID) for seed in (5, 6)]
    found = match(states[0], states[1], (ALL, ALL), np.zeros_like)
    along, stated = along_axes(found, found.displacement)
    told = inner(found)[:, None] & (stated < 0.6)
    assert np.sqrt((along[told] ** 2).mean()) < 0.25
    assert 0.7 < np.sqrt(((along / stated)[told] ** 2).mean()) < 1.4


def test_brightness_and_contrast_of_the_second_scan_do_not_count() -> None:
    first, second = pair()
    plain = match(first, second, (ALL, ALL), motion)
    other = match(first, second.with_array(0.9 * second.array + 25.0), (ALL, ALL), motion)
    here = inner(plain)
    error = (plain.displacement - motion(plain.points))[here]
    assert np.sqrt(((plain.displacement - other.displacement)[here] ** 2).mean()) < 0.2 * np.sqrt((error**2).mean())


def test_without_texture_nothing_is_said() -> None:
    """Even tissue with noise: the start is kept and hardly any precision is claimed."""
    states = [Volume(np.full(SHAPE, 40.0) + noise(seed, 15.0), GRID) for seed in (7, 8)]
    found = match(states[0], states[1], (ALL, ALL), np.zeros_like)
    _, stated = along_axes(found, found.displacement)
    assert (stated[inner(found)] > 1.0).mean() > 0.95


def test_an_edge_tells_its_normal_only() -> None:
    """A flat edge across x: the displacement along x is told, those along y and z are not."""
    step = ndimage.gaussian_filter(np.where(PLACES[..., 0] > 32.0, 40.0, -90.0), 0.9 / SPACING)
    states = [Volume(step + noise(seed, 10.0), GRID) for seed in (9, 10)]
    found = match(states[0], states[1], (ALL, ALL), np.zeros_like)
    at_edge = inner(found) & (np.abs(found.points[:, 0] - 32.0) < 2.0)
    across = found.precision[at_edge, 0, 0]
    assert at_edge.sum() > 5
    assert np.median(across) > 20.0 * np.median(found.precision[at_edge, 1, 1])


def test_what_is_not_usable_is_not_matched() -> None:
    first, second = pair()
    usable = PLACES[..., 1] > 30.0
    found = match(first, second, (usable, ALL), motion)
    index = np.rint(first.to_index(found.points)).astype(int)
    assert len(found.points) > 20
    assert (index[:, 1] * SPACING[1] > 28.0).all()


def test_the_correlation_of_noise_is_measured() -> None:
    """Noise filtered by a Gaussian of s voxels has a correlation of exp(-lag^2 / (4 s^2))."""
    sigma = 1.1
    made = ndimage.gaussian_filter(np.random.default_rng(1).standard_normal((60, 60, 60)), sigma).astype(np.float32)
    found = measured_correlation(made, np.ones(made.shape, dtype=bool))
    middle = len(found.kernels[0]) // 2
    assert found.kernels[0][middle] == pytest.approx(1.0)
    assert found.kernels[1][middle + 1] == pytest.approx(np.exp(-1.0 / (4.0 * sigma**2)), abs=0.03)
    assert found.kernels[2][middle + 2] == pytest.approx(np.exp(-4.0 / (4.0 * sigma**2)), abs=0.03)


def test_the_stated_precision_is_that_of_the_step_that_is_taken() -> None:
    """Steps that noise alone causes, in a window whose third direction has no texture."""
    random = np.random.default_rng(3)
    axes = np.linalg.qr(random.standard_normal((3, 3)))[0]
    lobules, cautious = (axes * [900.0, 300.0, 0.1]) @ axes.T, (axes * [40.0, 8.0, 0.0]) @ axes.T
    root = np.tril(random.standard_normal((3, 3))) + 3.0 * np.eye(3)
    noise = random.standard_normal((20_000, 3)) @ root.T
    steps = one_step(np.broadcast_to(lobules, (len(noise), 3, 3)), noise, np.broadcast_to(cautious, (len(noise), 3, 3)))
    precision = precision_of_step(lobules, root @ root.T, cautious)
    np.testing.assert_allclose(precision @ axes[:, 2], 0.0, atol=1e-9)
    told = axes[:, :2]
    expected = np.linalg.inv(told.T @ precision @ told)
    np.testing.assert_allclose(told.T @ np.cov(steps.T) @ told, expected, rtol=0.05, atol=0.02 * expected.max())
    assert np.abs(steps @ axes[:, 2]).max() < 1e-9
