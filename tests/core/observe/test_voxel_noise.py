"""Covariance of voxel errors from draws: that of the law they were drawn from, shared between states where it must be."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.observe.voxel_noise import VoxelNoise, voxel_covariance
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.surface import Surface

POINTS = np.random.default_rng(0).uniform(-20.0, 20.0, (30, 3))
# Nearly all error is on the cap z > 10 mm, and is one there.
CAP = np.where(POINTS[:, 2] > 10.0, 0.5, 0.02)
LENGTH_MM = 10.0


def surface(seed: int, draws: int = 400) -> Surface:
    rng = np.random.default_rng(seed)
    errors = CAP * rng.standard_normal((draws, 1)) + 0.01 * rng.standard_normal((draws, len(POINTS)))
    return Surface(POINTS, np.array([[0, 1, 2]]), np.array([1]), voxel_errors=errors)


def noise(pair: SurfacePair) -> VoxelNoise:
    return VoxelNoise.of(pair, POINTS, POINTS + 0.01)


def test_both_scans_add_up_and_the_scan_at_rest_is_common_to_all_states() -> None:
    rest = surface(1)
    first, second = noise(SurfacePair(rest, surface(2))), noise(SurfacePair(rest, surface(3)))
    own, shared = sum(first.covariances(first, LENGTH_MM)), first.covariances(second, LENGTH_MM)[0]
    variance = CAP**2 + 0.01**2
    np.testing.assert_allclose(np.diag(own), 2.0 * variance, rtol=0.25)
    np.testing.assert_allclose(np.diag(shared), variance, rtol=0.25)
    whole = voxel_covariance(
        [first, second], [(np.eye(33, 30),) * 2, (np.eye(30),) * 2], [slice(0, 33), slice(33, 63)], 66, LENGTH_MM
    )
    np.testing.assert_array_equal(whole, whole.T)
    np.testing.assert_allclose(whole[:30, 33:63], shared)
    assert not whole[30:33].any()  # landmarks know nothing of voxels
    assert not whole[63:].any()  # nor does a state that does not show the body
    assert np.linalg.eigvalsh(whole).min() > -1e-12


def test_correlation_ends_with_distance_and_a_surface_without_labels_has_none() -> None:
    one = noise(SurfacePair(surface(1), surface(2)))
    apart = np.linalg.norm(POINTS[:, None] - POINTS[None], axis=2)
    assert np.abs(sum(one.covariances(one, LENGTH_MM))[apart > 4.0 * LENGTH_MM]).max(initial=0.0) < 1e-3
    bare = Surface(POINTS, np.array([[0, 1, 2]]), np.array([1]))
    none = noise(SurfacePair(bare, bare))
    assert not sum(none.covariances(none, LENGTH_MM)).any()
    half = noise(SurfacePair(surface(1), bare))
    assert np.diag(sum(half.covariances(half, LENGTH_MM))) == pytest.approx(CAP**2 + 0.01**2, rel=0.25)


def test_what_the_surface_at_rest_does_beside_counts_for_its_own_errors_alone() -> None:
    one, rows = noise(SurfacePair(surface(1), surface(2))), slice(0, 30)
    at_rest, deformed = one.covariances(one, LENGTH_MM)
    found = voxel_covariance([one], [(3.0 * np.eye(30), np.eye(30))], [rows], 30, LENGTH_MM)
    np.testing.assert_allclose(found, 9.0 * at_rest + deformed)
