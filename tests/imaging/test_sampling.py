"""Compiled interpolation against SciPy's, inside and beyond the grid."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import ndimage

from palpate.imaging.sampling import linear, under_motion


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_linear_is_scipys_to_the_last_bit(kind: Any) -> None:
    rng = np.random.default_rng(1)
    fields = rng.normal(size=(7, 5, 6, 3)).astype(kind)
    index = np.vstack([rng.uniform(-2.0, 8.0, (500, 3)), [[0.0, 0.0, 0.0], [6.0, 4.0, 5.0], [3.0, 2.5, 5.0]]])
    wanted = [ndimage.map_coordinates(fields[..., c], index.T, order=1, mode="nearest") for c in range(3)]
    assert np.array_equal(linear(fields, index), np.stack(wanted, axis=-1).astype(np.float64))


@pytest.mark.parametrize("lattice", [(3, 4, 3), (1, 2, 1)])
def test_a_scan_under_a_motion_is_scipys(lattice: tuple[int, int, int]) -> None:
    """To the rounding of its numbers, within the grid, at its edges and far beyond."""
    rng = np.random.default_rng(2)
    coefficients, usable = (rng.uniform(size=(9, 11, 8)).astype(np.float32) for _ in range(2))
    ends = tuple((rng.integers(0, max(n - 1, 1), 7), rng.uniform(size=7) * (n > 1)) for n in lattice)
    nodes, voxels = rng.normal(0.0, 2.0, (*lattice, 3)), rng.integers(0, 7, (1000, 3))
    index = rng.uniform(-2.0, 12.0, (1000, 3))
    values, seen = under_motion(coefficients, usable, voxels, index, nodes, ends)
    below, above = (np.stack([end[k][voxels[:, a]] for a, end in enumerate(ends)]) for k in (0, 1))
    place = np.stack([ndimage.map_coordinates(nodes[..., c], below + above, order=1) for c in range(3)]) + index.T
    assert (place < 0.0).any() and (place > 12.0).any()
    wanted = ndimage.map_coordinates(coefficients, place, order=3, mode="nearest", prefilter=False)
    np.testing.assert_allclose(values, wanted, rtol=2e-6)
    np.testing.assert_allclose(seen, ndimage.map_coordinates(usable, place, order=1, mode="constant"), rtol=2e-6)


def test_no_points() -> None:
    assert linear(np.zeros((2, 2, 2, 3)), np.zeros((0, 3))).shape == (0, 3)
