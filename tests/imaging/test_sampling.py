"""Compiled interpolation against SciPy's, inside and beyond the grid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from palpate.imaging.sampling import cubic, linear


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_linear_is_scipys_to_the_last_bit(kind: Any) -> None:
    rng = np.random.default_rng(1)
    fields = rng.normal(size=(7, 5, 6, 3)).astype(kind)
    index = np.vstack([rng.uniform(-2.0, 8.0, (500, 3)), [[0.0, 0.0, 0.0], [6.0, 4.0, 5.0], [3.0, 2.5, 5.0]]])
    wanted = [ndimage.map_coordinates(fields[..., c], index.T, order=1, mode="nearest") for c in range(3)]
    assert np.array_equal(linear(fields, index), np.stack(wanted, axis=-1).astype(np.float64))


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_cubic_is_scipys_to_the_last_bit(kind: Any) -> None:
    rng = np.random.default_rng(2)
    coefficients = rng.normal(size=(9, 11, 8)).astype(kind)
    index = np.vstack([rng.uniform(-2.0, 12.0, (1000, 3)), [[3.0, 4.0, 5.0], [8.0, 10.0, 7.0], [1.0, 1.0, 1.0]]])
    wanted = ndimage.map_coordinates(coefficients, index.T, order=3, mode="nearest", prefilter=False)
    found = cubic(coefficients, index)
    assert found.dtype == kind
    assert np.array_equal(found, wanted)


def test_no_points() -> None:
    assert linear(np.zeros((2, 2, 2, 3)), np.zeros((0, 3))).shape == (0, 3)
    assert cubic(np.zeros((4, 4, 4)), np.zeros((0, 3))).shape == (0,)
