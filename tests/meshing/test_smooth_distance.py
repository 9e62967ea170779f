"""Distances and fields of voxel masks against SciPy's own of the whole grid."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from palpate.core.arrays import BoolArray
from palpate.meshing.separable import along_axis, cubic_weights, linear_weights
from palpate.meshing.smooth_distance import CLIP_MM, signed_distance


def blobs(seed: int) -> BoolArray:
    field = ndimage.gaussian_filter(np.random.default_rng(seed).normal(size=(40, 33, 27)), 3.0)
    return np.asarray(field > field.std())


@pytest.mark.parametrize(
    "spacing", [(1.25, 1.25, 1.25), (0.9765625, 0.9765625, 3.0), (0.7, 1.1, 2.5), (12.0, 1.0, 1.0)]
)
def test_signed_distance_is_scipys_to_the_last_bit(spacing: tuple[float, float, float]) -> None:
    mask, half = blobs(1), float(np.mean(spacing)) / 2.0
    inside, outside = (ndimage.distance_transform_edt(side, sampling=spacing) for side in (mask, ~mask))
    wanted = np.clip(np.where(mask, inside - half, half - outside), -CLIP_MM, CLIP_MM)
    assert np.array_equal(signed_distance(mask, np.array(spacing)), wanted)


@pytest.mark.parametrize("whole", [True, False])
def test_a_mask_without_a_boundary_is_far_from_it(whole: bool) -> None:
    found = signed_distance(np.full((4, 5, 6), whole), np.ones(3))
    assert (found == (CLIP_MM if whole else -CLIP_MM)).all()


def test_a_mask_that_is_no_whole_array_of_its_own() -> None:
    mask, spacing = blobs(2), np.array([1.0, 1.5, 2.0])
    assert np.array_equal(signed_distance(mask.T[::-1], spacing), signed_distance(mask.T[::-1].copy(), spacing))


def test_one_matrix_an_axis_is_the_spline_of_the_grid() -> None:
    values = np.random.default_rng(3).normal(size=(9, 8, 7))
    coefficients = ndimage.spline_filter(values, order=3)
    places = [np.linspace(2.0, n - 3.5, 6) for n in values.shape]
    at = np.stack(np.meshgrid(*places, indexing="ij"))
    for order, weights, out in ((3, cubic_weights, coefficients), (1, linear_weights, values)):
        wanted = ndimage.map_coordinates(out, at, order=order, prefilter=False)
        for axis in range(3):
            out = along_axis(weights(places[axis], values.shape[axis]), out, axis)
        assert np.allclose(out, wanted, rtol=0.0, atol=1e-13)


def test_linear_weights_beyond_the_grid_are_those_of_its_end() -> None:
    wanted = [[1.0, 0.0, 0.0], [0.0, 0.75, 0.25], [0.0, 0.0, 1.0]]
    assert linear_weights(np.array([-3.0, 1.25, 7.0]), 3).toarray().tolist() == wanted
