"""Where the rectum is begun with: a piece that fat bounds, else its gas, and nothing where there is neither."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.imaging.volume import Volume
from palpate.segmentation.bone.landmarks import Pelvis
from palpate.segmentation.rectum.tracking import BEHIND_MM, start_of
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask

STEP, SHAPE = 2.5, (64, 64, 40)
FRONT = np.array([[-5.0, -45.0, -20.0], [5.0, -40.0, 20.0]])
WHERE = np.array([2.0, FRONT[1, 1] + BEHIND_MM, 12.0])


def scene_of(hu: np.ndarray, gas: Mask) -> Scene:
    affine = np.diag([STEP, STEP, STEP, 1.0])
    affine[:3, 3] = -0.5 * STEP * (np.array(SHAPE) - 1)
    grid = Volume(np.zeros(SHAPE, dtype=np.uint8), affine)
    pelvis = Pelvis(np.array([1.0, 0.0, 0.0]), np.zeros(3), 1.0, FRONT, np.zeros((0, 3)))
    none = np.zeros(SHAPE, dtype=bool)
    filled = hu.astype(np.float32)
    return Scene(
        grid, np.where(gas, -400.0, filled).astype(np.float32), filled, gas, ~none, none, pelvis, grid, grid, -100.0, 45.0
    )  # fmt: skip


def ball(centre: np.ndarray, radius: float) -> Mask:
    index = np.moveaxis(np.indices(SHAPE), 0, -1)
    points = index * STEP - 0.5 * STEP * (np.array(SHAPE) - 1)
    return np.asarray(np.linalg.norm(points - centre, axis=-1) < radius)


def test_gas_begins_a_rectum_that_no_fat_bounds() -> None:
    """All soft tissue is one HU: gas in the usual place is found, gas beside it (a loop of bowel) is passed over."""
    gas = ball(WHERE, 8.0) | ball(WHERE + np.array([45.0, -20.0, 0.0]), 12.0)
    scene = scene_of(np.full(SHAPE, 40.0), gas)
    start = start_of(scene, np.zeros(SHAPE, dtype=bool))
    assert start is not None
    assert np.linalg.norm(start - WHERE) < 8.0


def test_what_fat_bounds_is_begun_with_where_there_is_such_a_piece() -> None:
    hu = np.where(ball(WHERE, 16.0), 40.0, -100.0)
    start = start_of(scene_of(hu, np.zeros(SHAPE, dtype=bool)), np.zeros(SHAPE, dtype=bool))
    assert start is not None
    np.testing.assert_allclose(start[:2], WHERE[:2], atol=2.0)


@pytest.mark.parametrize("gas_at", [None, np.array([60.0, -60.0, 10.0])])
def test_without_either_there_is_no_start(gas_at: np.ndarray | None) -> None:
    gas = np.zeros(SHAPE, dtype=bool) if gas_at is None else ball(gas_at, 8.0)
    assert start_of(scene_of(np.full(SHAPE, 40.0), gas), np.zeros(SHAPE, dtype=bool)) is None
