"""The analytic pelvis and its scanner: what they promise of any point."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.imaging.labels import LABELS
from palpate.imaging.volume import Volume
from palpate.simulate.phantom import phantom
from palpate.simulate.phantom.anatomy import BLADDER, PROSTATE, PUBIS, RECTUM
from palpate.simulate.phantom.solids import Capsule, Ellipsoid, Solid, Trunk
from palpate.simulate.phantom.unions import Shrunk, Union
from palpate.simulate.scanner import Scanner, voxel_mean

SPACING = np.array([2.0, 2.0, 3.0])


def _grid(size: tuple[int, int, int], spacing: np.ndarray, centre: np.ndarray) -> Volume:
    affine = np.diag([*spacing, 1.0])
    affine[:3, 3] = centre - 0.5 * spacing * (np.array(size) - 1)
    return Volume(np.zeros(size, dtype=np.uint8), affine)


@pytest.fixture(scope="module")
def region() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points of a box about the prostate, their labels and HU."""
    grid = _grid((56, 64, 44), SPACING, np.array(phantom.prostate_centroid()) + [0.0, 8.0, 12.0])
    points = grid.to_lps(np.argwhere(np.ones(grid.array.shape)).astype(float))
    return points, phantom.labels(points), phantom.hu(points)


def test_every_label_is_there_and_has_the_hu_of_its_tissue(region: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    _, labels, hu = region
    assert set(np.unique(labels)) == {value for value in LABELS if value}
    median = {name: float(np.median(hu[labels == value])) for value, name in LABELS.items() if value}
    assert median["bone"] > 180
    assert abs(median["prostate_left"] - median["prostate_right"]) < 6  # stiffness is not seen in HU
    assert -10 < median["bladder"] < 25
    assert hu[labels == 6].min() < -900  # gas
    # Fat lies against the prostate, so that CT shows its outline.
    assert np.median(hu[labels == 3]) < 60
    assert np.percentile(hu[labels == 3], 20) < -80


def test_prostate_is_divided_at_its_centroid(region: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    points, labels, _ = region
    x = phantom.prostate_centroid()[0]
    assert points[labels == 1][:, 0].min() > x > points[labels == 2][:, 0].max()
    organ = points[np.isin(labels, (1, 2))]
    assert organ.mean(axis=0) == pytest.approx(phantom.prostate_centroid(), abs=0.3)


def test_bladder_is_above_and_rectum_behind_the_prostate(region: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    points, labels, _ = region
    centre = {value: points[labels == value].mean(axis=0) for value in (1, 2, 5, 6)}
    assert centre[1][0] > centre[2][0]  # +x is the patient's left
    assert centre[5][2] > centre[1][2] + 20
    assert centre[6][1] > centre[1][1] + 20


def test_left_and_right_differ(region: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
    """A mirrored pelvis would be noticed: many voxels change their label."""
    points, labels, _ = region
    middle = phantom.prostate_centroid()[0]
    mirrored = points * [-1.0, 1.0, 1.0] + [2.0 * middle, 0.0, 0.0]
    swapped = np.array([0, 2, 1, 3, 4, 5, 6])[phantom.labels(mirrored)]
    hollow = np.isin(labels, (4, 5, 6))
    assert (swapped[hollow] != labels[hollow]).mean() > 0.1


@pytest.mark.parametrize(
    "solid",
    [
        Ellipsoid((1.0, -2.0, 3.0), (20.0, 14.0, 9.0)),
        Ellipsoid((1.0, -2.0, 3.0), (20.0, 14.0, 9.0), 2.6),
        Capsule((0.0, 0.0, 0.0), (10.0, 20.0, 30.0), 6.0),
        Capsule((0.0, 0.0, 0.0), (10.0, 20.0, 30.0), 8.0, 6.0),
        Trunk((0.0, 0.0), 40.0, 30.0, 20.0, 25.0),
        Union((Ellipsoid((0.0, 0.0, 0.0), (9.0, 9.0, 9.0)), Ellipsoid((8.0, 0.0, 0.0), (8.0, 8.0, 8.0))), 5.0),
        Shrunk(Ellipsoid((0.0, 0.0, 0.0), (20.0, 20.0, 20.0)), 3.0),
        PROSTATE,
        BLADDER,
        RECTUM,
        PUBIS,
    ],
)
def test_distance_is_signed_and_of_unit_slope_at_the_surface(solid: Solid) -> None:
    """Edges are then as wide as they are meant to be, everywhere."""
    low, high = (np.clip(corner, -60.0, 60.0) for corner in solid.bounds)
    points = np.random.default_rng(3).uniform(low - 4.0, high + 4.0, size=(60_000, 3))
    near = points[np.abs(solid.distance(points)) < 0.4]
    assert len(near) > 50
    step = 1e-4
    gradient = np.stack(
        [(solid.distance(near + step * e) - solid.distance(near - step * e)) / (2 * step) for e in np.eye(3)], axis=1
    )
    slope = np.linalg.norm(gradient, axis=1)
    assert np.percentile(np.abs(slope - 1.0), 90) < 0.15
    assert (solid.distance(points) < 0).any()
    beyond = ((points < solid.bounds[0]) | (points > solid.bounds[1])).any(axis=1)
    assert (solid.distance(points[beyond]) > 0).all()


def test_an_edge_is_blurred_by_voxel_and_point_spread_but_not_moved() -> None:
    """The integral across a fat-to-muscle plane does not depend on blur; its width grows as the variances add."""
    grid = _grid((60, 8, 6), np.array([0.5, 2.0, 2.0]), np.zeros(3))
    sharp, blurred = (
        Scanner(blur_mm=b, noise_hu=0.0).expose(lambda p: np.where(p[:, 0] > 1.1, 50.0, -90.0), grid)[:, 4, 3]
        for b in (0.0, 1.0)
    )
    assert blurred.sum() == pytest.approx(sharp.sum(), rel=1e-4)
    x = grid.to_lps(np.column_stack([np.arange(60), np.zeros(60), np.zeros(60)]))[:, 0]
    rise = np.gradient(blurred, x)
    mean = (rise @ x) / rise.sum()
    sd = np.sqrt(rise @ (x - mean) ** 2 / rise.sum())
    # An edge between two voxel centres is only known to a quarter of a voxel.
    assert mean == pytest.approx(1.1, abs=0.2)
    assert sd == pytest.approx(np.hypot(1.0, 0.5 / np.sqrt(6.0)), abs=0.12)


def test_noise_has_its_sd_is_correlated_and_repeats_with_its_seed() -> None:
    grid = _grid((90, 90, 12), np.array([1.2, 1.2, 2.0]), np.zeros(3))
    scanner = Scanner(noise_hu=12.0)
    first, again, other = (scanner.scan(lambda p: np.zeros(len(p)), grid, seed).array for seed in (1, 1, 2))
    assert first.dtype == np.int16
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    middle = first[30:60, 30:60].astype(float)
    assert middle.std() == pytest.approx(12.0, rel=0.15)
    assert 0.2 < np.corrcoef(middle[1:].ravel(), middle[:-1].ravel())[0, 1] < 0.8


def test_voxel_mean_of_a_linear_field_is_its_value_at_the_centre() -> None:
    grid = _grid((7, 5, 9), np.array([1.5, 2.0, 3.0]), np.array([10.0, -20.0, 30.0]))
    mean = voxel_mean(lambda p: p @ np.array([1.0, -2.0, 0.5]), grid, (2, 3, 2))
    points = grid.to_lps(np.argwhere(np.ones(grid.array.shape)).astype(float))
    assert mean.ravel() == pytest.approx(points @ np.array([1.0, -2.0, 0.5]), abs=1e-4)
