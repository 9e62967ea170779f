"""What a simulation says when tissue folds: where, and which wall that was moved is nearest."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.errors import ConvergenceError
from palpate.core.mesh import TetMesh
from palpate.meshing.mesh_labels import MeshedCase
from palpate.simulate.strain_figures import smallest_volume_ratio


def test_the_nearest_wall_is_named_with_its_motion() -> None:
    points = np.array([[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]])
    meshed = MeshedCase(TetMesh(points, np.array([[0, 1, 2, 3]]), np.array([3])), {}, {})
    turned = np.diag([1.0, 1.0, -0.2])[None, None]
    walls = {
        "bladder": (np.array([[1.0, 1.0, 31.0]]), np.array([[0.0, 0.0, -9.0]])),
        "rectum": (np.array([[1.0, 6.0, 1.0], [1.0, 60.0, 1.0]]), np.array([[0.0, -3.0, -4.0], [0.0, 0.0, 0.0]])),
    }
    wanted = r"volume ratio -0\.20 at \[1\.0, 1\.0, 1\.0\] mm\), 5 mm from the rectum's wall, which moves 5\.0 mm there"
    with pytest.raises(ConvergenceError, match=wanted):
        smallest_volume_ratio(meshed, turned, walls)
    assert smallest_volume_ratio(meshed, np.eye(3)[None, None], walls) == 1.0
