"""The second scan of a real body: its noise is its own, its contents are others, its tissue is where it moved."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import ndimage

from palpate.core.arrays import Float32Array
from palpate.imaging.labels import BLADDER, PROSTATE_LEFT, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.simulate import other_day
from palpate.simulate.other_day import denoised
from palpate.simulate.second_scan import SecondScan
from palpate.simulate.source import VolumeSource, labels_on

SHAPE, SPACING = (40, 40, 24), np.array([1.5, 1.5, 2.0])
GRID = np.diag([*SPACING, 1.0])
PLACES = np.moveaxis(np.indices(SHAPE), 0, -1) * SPACING
NOISE_HU, SHIFT = 15.0, np.array([3.0, 0.0, 0.0])


def ball(centre: tuple[float, float, float], radius: float) -> np.ndarray:
    return np.asarray(((PLACES - np.array(centre)) ** 2).sum(axis=-1) < radius**2)


@pytest.fixture(scope="module")
def source() -> VolumeSource:
    labels = np.full(SHAPE, SURROUNDING_TISSUE, dtype=np.uint8)
    labels[ball((20, 30, 24), 10.0)], labels[ball((44, 30, 24), 12.0)] = PROSTATE_LEFT, BLADDER
    hu = np.where(labels == PROSTATE_LEFT, 40.0, np.where(labels == BLADDER, 200.0, -90.0))
    noise = ndimage.gaussian_filter(np.random.default_rng(1).standard_normal(SHAPE), (0.5, 0.5, 0.2))
    ct = np.rint(hu + NOISE_HU * noise / noise.std()).astype(np.int16)
    return VolumeSource("made-up", Volume(labels, GRID), Volume(ct, GRID))


def test_the_scan_at_rest_is_the_ct_itself(source: VolumeSource) -> None:
    assert source.ct is not None
    np.testing.assert_array_equal(source.scan(None, None, 3).array, source.ct.array)


def test_noise_at_rest_can_be_drawn_anew_and_nothing_else_changes(source: VolumeSource) -> None:
    assert source.ct is not None
    anew = VolumeSource("made-up", source.model_labels, source.ct, noise_anew=True)
    one, two, other = (anew.scan(None, None, seed).array.astype(float) for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, two)
    fat = ndimage.binary_erosion(source.model_labels.array == SURROUNDING_TISSUE, iterations=3)
    for first, second in ((one, other), (one, source.ct.array.astype(float))):
        assert abs(np.corrcoef(first[fat], second[fat])[0, 1]) < 0.3
    assert one[fat].std() == pytest.approx(NOISE_HU, rel=0.25)
    # Contents stay: the bladder's medium, which a second scan would not have.
    assert one[ball((44, 30, 24), 8.0)].mean() == pytest.approx(200.0, abs=3.0)


def test_denoising_moves_no_texture() -> None:
    """Non-local means in its quick form moves texture by a fifth of a voxel: least-squares shift of the denoised image."""
    random = np.random.default_rng(5)
    lumps = ndimage.gaussian_filter(random.standard_normal((48, 48, 32)), 1.3)
    clean = 30.0 * lumps / lumps.std()
    found = denoised((clean + random.normal(0.0, 10.0, clean.shape)).astype(np.float32), 10.0)
    slope = np.stack([g.ravel() for g in np.gradient(clean)], axis=1)
    shift = np.linalg.lstsq(slope, (clean - found).ravel(), rcond=None)[0]
    assert np.abs(shift).max() < 0.03, shift
    assert (found - clean).std() < 10.0


def test_no_noise_moves_along_and_as_much_is_there(source: VolumeSource) -> None:
    again = source.scan(lambda points: points, None, 3)
    fat = ndimage.binary_erosion(source.model_labels.array == SURROUNDING_TISSUE, iterations=3)
    first, second = (v.array[fat].astype(float) for v in (source.scan(None, None, 3), again))
    assert abs(np.corrcoef(first, second)[0, 1]) < 0.3
    assert second.std() == pytest.approx(NOISE_HU, rel=0.25)


def test_tissue_moves_and_urine_is_another(source: VolumeSource) -> None:
    moved = source.scan(lambda points: points - SHIFT, None, 3)
    bright = ndimage.gaussian_filter(moved.array.astype(float), 1.0) > -25.0
    near = bright & ball((23, 30, 24), 14.0) & ~ball((47, 30, 24), 13.0)
    np.testing.assert_allclose(PLACES[near].mean(axis=0), [23.0, 30.0, 24.0], atol=1.0)
    assert moved.array[ball((47, 30, 24), 6.0)].mean() < 70.0


def test_the_same_seed_makes_the_same_scan_and_contrast_shows(source: VolumeSource) -> None:
    one, two, other = (source.scan(lambda points: points, None, seed).array for seed in (3, 3, 4))
    np.testing.assert_array_equal(one, two)
    assert (one != other).any()
    brighter = VolumeSource("made-up", source.model_labels, source.ct, ("contrast",))
    inside = ball((20, 30, 24), 7.0)
    gain = brighter.scan(lambda points: points, None, 3).array[inside].mean() - one[inside].mean()
    # Within two standard deviations of the uneven brightness.
    assert gain == pytest.approx(0.15 * 140.0, abs=16.0)


def test_a_scan_is_denoised_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two pairs of one CT, and both scans of a pair whose noise is drawn anew, share it."""
    calls: list[float] = []

    def once(hu: Float32Array, noise_hu: float) -> Float32Array:
        calls.append(noise_hu)
        return hu

    monkeypatch.setattr(other_day, "_non_local_means", once)
    hu = np.random.default_rng(11).normal(size=(6, 5, 4)).astype(np.float32)
    first = denoised(hu, 7.0)
    assert denoised(hu.copy(), 7.0) is first and len(calls) == 2  # there and back
    denoised(hu, 8.0)
    denoised(hu + 1.0, 7.0)
    assert len(calls) == 6


def test_the_noise_of_a_body_is_that_of_its_urine_whatever_voxels_its_contours_have(source: VolumeSource) -> None:
    shares = [
        SecondScan.of(*parts(s)).noise_hu for s in (source, source.on_voxels_of_its_own(np.random.default_rng(2)))
    ]
    assert shares[0] == shares[1] == pytest.approx(NOISE_HU, rel=0.25)


def parts(source: VolumeSource) -> tuple[Volume, Volume, Callable[[Volume], Volume], np.random.Generator]:
    assert source.ct is not None
    return source.ct, source.body, lambda grid: labels_on(source.labels, grid), np.random.default_rng(1)
