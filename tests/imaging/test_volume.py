"""Values of a volume between its voxels."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.surfaces.rigid_motion import transformed
from palpate.imaging.volume import Volume

AFFINE = np.array([[-1.5, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, -20.0], [0.0, 0.0, 3.0, 5.0], [0.0, 0.0, 0.0, 1.0]])


@pytest.mark.parametrize("dtype", [np.float64, np.float32, np.int16])
def test_a_linear_function_is_met_between_the_voxels_and_held_at_the_edge_beyond(dtype: type) -> None:
    i, j, k = np.indices((4, 5, 6))
    volume = Volume((3 * i - 2 * j + 7 * k).astype(dtype), AFFINE)
    index = np.array([[1.5, 2.25, 3.75], [0.0, 0.0, 0.0], [3.0, 4.0, 5.0]])
    assert volume.at(transformed(AFFINE, index)) == pytest.approx([26.25, 0.0, 36.0], abs=1e-5)
    assert volume.at(transformed(AFFINE, np.array([[9.0, 4.0, 5.0], [-2.0, 0.0, -1.0]]))) == pytest.approx([36.0, 0.0])


def test_an_affine_map_turns_and_shifts() -> None:
    quarter = np.array([[0.0, -1.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
    assert transformed(quarter, np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 5.0]])).tolist() == [
        [1.0, 3.0, 3.0],
        [0.0, 2.0, 8.0],
    ]
