"""What is too thin, too deep or too pointed: corridors of a bladder, the inside of a neighbour, the ends of a shape."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.segmentation.bladder.urine import Urine, _calm
from palpate.segmentation.methods.extreme_points import POWER, ellipsoid_of
from palpate.segmentation.prostate.random_walk_fit import deep_in

STEP_MM = 1.25


def _places(half: int) -> list[np.ndarray]:
    """Coordinates x, y, z, mm, about the middle of a cube of voxels."""
    return list(np.meshgrid(*[STEP_MM * np.arange(-half, half + 1)] * 3, indexing="ij"))


def test_a_thin_corridor_of_urines_hu_is_no_bladder() -> None:
    """Partial volume along a vessel: of urine's HU, in touch with the bladder and close to it, but no ball wide."""
    x, y, z = _places(24)
    ball = x**2 + y**2 + z**2 < 15.0**2
    corridor = (x > 0.0) & (x < 21.0) & (np.hypot(y, z) < 2.0)
    core = ball | corridor
    smooth = np.where(core, 0.0, 60.0).astype(np.float32)
    urine = Urine(0.0, 3.0, 5.0, smooth, np.where(ball, 3.0, 30.0))
    calm = _calm(urine, smooth, core, np.ones_like(core), STEP_MM)
    assert calm[ball].mean() > 0.98
    assert not calm[corridor & (x > 17.5)].any()


def test_only_the_inside_of_a_large_neighbour_is_sure() -> None:
    """A bladder is, a wall's breadth within; a urethra that resection has opened, found as bladder, is not."""
    x, y, z = _places(28)
    bladder, urethra = x**2 + y**2 + (z - 10.0) ** 2 < 16.0**2, (np.hypot(x, y) < 6.0) & (z < 0.0)
    deep = deep_in(bladder | urethra, STEP_MM)
    assert deep[x**2 + y**2 + (z - 10.0) ** 2 < 10.0**2].all()
    assert not deep[(z < -8.0) | ~bladder].any()


def test_a_shape_from_six_points_ends_bluntly() -> None:
    """Half-width of a section at nine tenths of the height: wider than the ellipsoid's."""
    points = np.concatenate([np.diag([20.0, 20.0, 25.0]), -np.diag([20.0, 20.0, 25.0])])
    made = ellipsoid_of(points)
    wide = 20.0 * np.sqrt(1.0 - 0.9**POWER)
    assert wide > 1.05 * 20.0 * np.sqrt(1.0 - 0.9**2)
    assert made.level_of(np.array([wide, 0.0, 0.9 * 25.0])) == pytest.approx(1.0, abs=1e-6)
    assert made.level_of(points) == pytest.approx(np.ones(6))
