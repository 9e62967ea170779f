"""Distances and filled holes on an even grid against scipy's and ITK's own."""

from __future__ import annotations

import numpy as np
import pytest
import SimpleITK as sitk
from scipy import ndimage

from palpate.segmentation.working_grid import (
    Mask,
    depth_of,
    dilated,
    distance_of,
    distance_to,
    eroded,
    filled,
    signed_distance,
    upright,
)

STEP = 1.25
GRID = upright(np.array([-20.0, -15.0, -25.0]), np.array([12.0, 22.0, 21.0]), STEP)


def masks() -> list[Mask]:
    """Scattered voxels, sparse and dense, and one smooth region that meets the grid's end."""
    random = np.random.default_rng(11)
    shape = GRID.array.shape
    scattered = [random.random(shape) < share for share in (0.001, 0.3, 0.6, 0.999)]
    return [*scattered, ndimage.gaussian_filter(random.normal(size=shape), 4.0) > 0.0]


@pytest.mark.parametrize("mask", masks())
def test_distances_are_those_of_scipy(mask: Mask) -> None:
    outside, inside = (ndimage.distance_transform_edt(m, sampling=STEP) for m in (~mask, mask))
    np.testing.assert_allclose(distance_to(mask, STEP), outside, rtol=1e-14, atol=0.0)
    assert depth_of(mask, STEP) == pytest.approx(inside.max())
    for radius in (STEP, 2.0 * STEP, 3.3):
        assert np.array_equal(dilated(mask, radius, STEP), outside <= radius)
        assert np.array_equal(eroded(mask, radius, STEP), inside > radius)
    signed = signed_distance(mask, GRID)
    np.testing.assert_allclose(signed.array, outside - inside + np.where(mask, 0.5, -0.5) * STEP, rtol=1e-6)
    # Some of the points lie beyond the grid.
    points = np.random.default_rng(5).uniform(-30.0, 30.0, (200, 3))
    np.testing.assert_allclose(distance_of(points, mask, GRID), signed.at(points), rtol=1e-6, atol=1e-6)


def test_distances_of_nothing_and_of_everything_are_infinite() -> None:
    nothing = np.zeros(GRID.array.shape, dtype=bool)
    assert np.isposinf(distance_to(nothing, STEP)).all()
    assert np.isposinf(distance_of(np.zeros((2, 3)), nothing, GRID)).all()
    assert np.isneginf(distance_of(np.zeros((2, 3)), ~nothing, GRID)).all()


@pytest.mark.parametrize("mask", masks())
def test_holes_are_filled_as_scipy_and_itk_fill_them(mask: Mask) -> None:
    assert np.array_equal(filled(mask), ndimage.binary_fill_holes(mask))
    for axis in range(3):
        slices = np.moveaxis(filled(mask, within=axis), axis, 0)
        for found, section in zip(slices, np.moveaxis(mask, axis, 0), strict=True):
            image = sitk.BinaryFillhole(sitk.GetImageFromArray(section.astype(np.uint8)))
            assert np.array_equal(found, sitk.GetArrayFromImage(image) > 0)
