"""Scores of windows against motions that are known: they hold for motion that is uneven within a window."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.linalg import cholesky, solve_triangular
from test_local_matching import ALL, inner, motion, pair

from palpate.core.window_scores import WindowScores
from palpate.imaging.matching.local_matching import match
from palpate.imaging.matching.noise import LEAST_SHARE, noise_shares
from palpate.imaging.matching.scan_pair import ScanPair
from palpate.imaging.matching.scores import window_scores
from palpate.imaging.matching.window_fits import equations_under
from palpate.imaging.volume import Volume


@pytest.fixture(scope="module")
def scores() -> WindowScores:
    first, second = pair()
    found = match(first, second, (ALL, ALL), lambda points: motion(points) + np.array([0.4, -0.3, 0.5]))
    return window_scores(found.compared, found.windows[inner(found)])


def whitened(scores: WindowScores, values: np.ndarray) -> np.ndarray:
    covariance = scores.covariance + 0.01 * np.eye(len(values))
    return np.asarray(solve_triangular(cholesky(covariance, lower=True), values, lower=True))


def test_errors_are_together_as_large_as_stated(scores: WindowScores) -> None:
    error = scores.value - scores.response @ motion(scores.nodes).ravel()
    np.testing.assert_allclose(np.diag(scores.covariance), 1.0)
    assert 0.85 < np.sqrt((whitened(scores, error) ** 2).mean()) < 1.2


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_motion_of_all_tissue_is_told_as_surely_as_stated(scores: WindowScores, axis: int) -> None:
    """Averages over many windows do not err alike: 0.1 mm of one motion shows."""
    error = scores.value - scores.response @ motion(scores.nodes).ravel()
    shown = whitened(scores, np.asarray(scores.response[:, axis::3].sum(axis=1)).ravel())
    sd = 1.0 / np.linalg.norm(shown)
    assert sd < 0.03
    assert abs(shown @ whitened(scores, error)) * sd**2 < 3.5 * sd


def test_another_motion_within_the_windows_is_told_apart(scores: WindowScores) -> None:
    """Tissue that strains on one side of a plane only, by as little as no shift of a window shows."""
    middle = scores.middles.mean(axis=0)
    kink = 0.15 * np.maximum(scores.nodes - middle, 0.0)[:, :1] * np.array([1.0, 0.0, 0.0])
    error = scores.value - scores.response @ motion(scores.nodes).ravel()
    shown = whitened(scores, scores.response @ kink.ravel())
    sd = 1.0 / np.linalg.norm(shown)
    assert sd < 0.05
    assert abs(shown @ whitened(scores, error)) * sd**2 < 3.5 * sd


def test_scores_keep_their_numbers_in_arrays_and_in_a_part(scores: WindowScores) -> None:
    again = WindowScores.from_arrays(scores.arrays())
    np.testing.assert_allclose(again.response.toarray(), scores.response.toarray(), atol=1e-6)
    np.testing.assert_array_equal(again.covariance, scores.covariance)
    half = np.arange(len(scores.middles)) % 2 == 0
    rows = np.repeat(half, 3)
    part = scores.of(half)
    np.testing.assert_array_equal(part.covariance, scores.covariance[np.ix_(rows, rows)])
    np.testing.assert_array_equal(part.value, scores.value[rows])
    everywhere = np.ones(len(scores.nodes), dtype=bool)
    np.testing.assert_allclose(scores.share_at(everywhere), 1.0)
    np.testing.assert_allclose(scores.share_at(~everywhere), 0.0)


def test_the_covariance_holds_where_windows_lie_close_together() -> None:
    """Windows about neighbouring bright spots see nearly the same voxels: no combination of scores is surer than sure."""
    first, second = pair()
    spots = 30.0 + 3.0 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1], [2, 0, 0], [0, 2, 0]])
    found = match(first, second, (ALL, ALL), motion, bright=spots)
    C = window_scores(found.compared, found.windows).covariance
    assert len(C) > 100
    assert np.linalg.eigvalsh(C).min() > -1e-4


@pytest.mark.parametrize("other_hu", [20.0, 40.0, 60.0])
def test_noise_beside_an_edge_moves_nothing(other_hu: float) -> None:
    """Two scans of one body that did not move, the second with noise of any size: over many draws of noise no window's score has a mean
    but by chance."""
    shape, draws = (36, 16, 16), 60
    body = ndimage.gaussian_filter(np.where(np.arange(36.0) > 18.0, 50.0, -100.0), 1.0)[:, None, None]
    everywhere, random = np.ones(shape, dtype=bool), np.random.default_rng(0)

    def scan(noise_hu: float) -> Volume:
        rough = ndimage.gaussian_filter(random.standard_normal(shape), 0.7)
        return Volume((body + noise_hu * rough / rough.std()).astype(np.float32), np.eye(4))

    found = []
    for _ in range(draws):
        two = ScanPair.of(scan(40.0), scan(other_hu), (everywhere, everywhere), np.zeros_like, 0.9, 3.0)
        found.append(equations_under(two, *two.moved(np.zeros_like(two.windows.nodes))).right)
    mean, sd = np.mean(found, axis=0), np.std(found, axis=0, ddof=1)
    assert np.sqrt((draws * (mean / sd) ** 2).mean()) < 1.5


def test_the_noise_of_each_scan_is_told_from_what_both_show() -> None:
    random, shape = np.random.default_rng(4), (40, 40, 40)
    picture = 30.0 * random.standard_normal(shape)  # as fine as the noise, and larger
    weight = np.ones(shape, dtype=np.float32)

    def scan(noise_hu: float) -> np.ndarray:
        return np.asarray(picture + noise_hu * random.standard_normal(shape), dtype=np.float32)

    assert noise_shares(scan(10.0), scan(10.0), weight) == pytest.approx((0.5, 0.5), abs=0.03)
    ours, theirs = noise_shares(scan(10.0), scan(20.0), weight)
    assert (ours, theirs) == pytest.approx((0.2, 0.8), abs=0.03)
    outside = weight.copy()
    outside[:20] = 0.0
    mixed = np.concatenate([scan(40.0)[:20], scan(10.0)[20:]])
    assert noise_shares(mixed, scan(10.0), outside)[0] == pytest.approx(
        0.5, abs=0.04
    )  # where no voxel counts, noise does not
    assert noise_shares(scan(0.0), scan(0.0), weight) == (0.5, 0.5)
    assert noise_shares(scan(0.0), scan(20.0), weight)[0] == LEAST_SHARE
