"""The rectum's course: a piece that fat bounds, else its gas, and nothing where there is neither."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.imaging.volume import Volume
from palpate.segmentation.bone.landmarks import Pelvis
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.rectum.course import course_of
from palpate.segmentation.rectum.outlines import Track
from palpate.segmentation.rectum.rectum import find_rectum
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask

STEP, SHAPE = 2.5, (64, 64, 40)
FRONT = np.array([[-5.0, -45.0, -20.0], [5.0, -40.0, 20.0]])
WHERE = np.array([2.0, FRONT[1, 1] + 62.0, 12.0])
ENDS = (-20.0, 45.0)
NONE = np.zeros(SHAPE, dtype=bool)


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


def tube(radius: float) -> Mask:
    """About a vertical line through WHERE."""
    index = np.moveaxis(np.indices(SHAPE), 0, -1)
    points = index * STEP - 0.5 * STEP * (np.array(SHAPE) - 1)
    return np.asarray(np.hypot(*np.moveaxis(points - WHERE, -1, 0)[:2]) < radius)


def middle_at(course: Track | None, z: float) -> np.ndarray:
    assert course is not None
    return np.array([np.interp(z, course.z, course.centres[:, axis]) for axis in range(2)])


def test_gas_begins_a_rectum_that_no_fat_bounds() -> None:
    """All soft tissue is one HU: gas in the usual place is found, gas beside it (a loop of bowel) is passed over."""
    gas = ball(WHERE, 8.0) | ball(WHERE + np.array([45.0, -20.0, 0.0]), 12.0)
    scene = scene_of(np.full(SHAPE, 40.0), gas)
    assert np.linalg.norm(middle_at(course_of(scene, NONE, ENDS), WHERE[2]) - WHERE[:2]) < 8.0


def test_what_fat_bounds_is_begun_with_where_there_is_such_a_piece() -> None:
    hu = np.where(ball(WHERE, 16.0), 40.0, -100.0)
    course = course_of(scene_of(hu, NONE), NONE, ENDS)
    np.testing.assert_allclose(middle_at(course, WHERE[2]), WHERE[:2], atol=2.0)


@pytest.mark.parametrize("gas_at", [None, np.array([60.0, -60.0, 10.0])])
def test_without_either_there_is_no_start(gas_at: np.ndarray | None) -> None:
    gas = NONE if gas_at is None else ball(gas_at, 8.0)
    assert course_of(scene_of(np.full(SHAPE, 40.0), gas), NONE, ENDS) is None


def test_a_tube_is_followed_across_a_gap_in_which_nothing_shows() -> None:
    """15 mm of the tube look like fat: the course goes on to the end, where following from slice to slice ends."""
    hu = np.where(tube(14.0), 40.0, -100.0)
    hu[:, :, 18:24] = -100.0
    course = course_of(scene_of(hu, NONE), NONE, ENDS)
    for z in (-15.0, 40.0):
        np.testing.assert_allclose(middle_at(course, z), WHERE[:2], atol=3.0)


def test_a_click_leads_the_course_to_another_tube() -> None:
    there = np.array([40.0, 0.0, 0.0])
    hu = np.where(tube(14.0) | np.roll(tube(14.0), round(there[0] / STEP), axis=0), 40.0, -100.0)
    scene = scene_of(hu, NONE)
    np.testing.assert_allclose(middle_at(course_of(scene, NONE, ENDS), 0.0), WHERE[:2], atol=3.0)
    led = course_of(scene, NONE, ENDS, WHERE + there)
    np.testing.assert_allclose(middle_at(led, WHERE[2]), (WHERE + there)[:2], atol=3.0)


def test_the_muscle_about_a_rectum_is_left_out_beside_the_symphysis() -> None:
    """Below the symphysis' upper edge a ring of 6 mm of the same HU lies about a tube of 13 mm: the tube is drawn as wide as above."""
    hu = np.where(tube(13.0), 40.0, -100.0)
    low = scene_of(hu, NONE).axes()[2].ravel() < FRONT[1, 2]
    hu[:, :, low] = np.where(tube(19.0)[:, :, low], 40.0, -100.0)
    found = find_rectum(scene_of(hu, NONE), Prompts(), None)
    assert found is not None
    wide = np.sqrt(found.mask.sum(axis=(0, 1)) * STEP**2 / np.pi)
    beside = low & (wide > 0.0) & (scene_of(hu, NONE).axes()[2].ravel() > 0.0)
    assert beside.sum() > 4
    assert wide[beside].max() < 16.0
