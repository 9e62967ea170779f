"""Six outermost points of an organ give its shape, whatever HU are and whether the picture shows it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from organ_scans import found, truth_of

from palpate.imaging.labels import BLADDER
from palpate.segmentation.bladder.bladder import find_bladder
from palpate.segmentation.points_fit import between, held_to, misses, ran_away, shape_within
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask, dilated, eroded, mask_on
from palpate.validate.segmentation.dice import dice, extremes_of

POINTS = extremes_of(truth_of(BLADDER))


@cache
def _bladder() -> Mask:
    return mask_on(truth_of(BLADDER), found().scene.grid)


def _like(hu: np.ndarray) -> Scene:
    """The scene with another picture."""
    return replace(found().scene, hu=hu.astype(np.float32), filled=hu.astype(np.float32))


@pytest.mark.parametrize("turned", [1.0, -1.0], ids=["plain", "inverted"])
def test_the_shape_within_six_points_asks_nothing_of_hu(turned: float) -> None:
    scene = _like(turned * found().scene.filled + 300.0)
    shape = shape_within(scene, POINTS, scene.bone)
    assert dice(shape, _bladder()) > 0.9
    assert not ran_away(scene, shape, POINTS, shape)


def test_a_bladder_that_no_picture_shows_is_still_drawn_from_six_points() -> None:
    scene = _like(np.full(found().scene.hu.shape, 40.0) + np.random.default_rng(1).normal(0, 9, found().scene.hu.shape))
    drawn = find_bladder(scene, Prompts({}, {"bladder": POINTS}))
    assert drawn is not None and drawn.method == "extremes"
    assert dice(drawn.mask, _bladder()) > 0.85


@pytest.mark.parametrize("off_mm", [-4.0, 4.0], ids=["too small", "too large"])
def test_a_surface_that_misses_all_points_alike_is_moved_to_them(off_mm: float) -> None:
    scene = found().scene
    wrong = dilated(_bladder(), off_mm, scene.step) if off_mm > 0.0 else eroded(_bladder(), -off_mm, scene.step)
    held = held_to(scene, wrong, POINTS)
    assert dice(held, _bladder()) > 0.96 > dice(wrong, _bladder())
    assert misses(scene, held, POINTS) < 1.0 < misses(scene, wrong, POINTS)
    assert held_to(scene, _bladder(), POINTS) is _bladder()


def test_a_surface_far_from_its_points_has_run_away() -> None:
    scene = found().scene
    elsewhere = np.roll(_bladder(), 20, axis=0)
    assert ran_away(scene, elsewhere, POINTS, _bladder())
    assert not ran_away(scene, dilated(_bladder(), 2.0, scene.step), POINTS, _bladder())


def test_half_way_between_two_masks_lies_a_third() -> None:
    scene = found().scene
    smaller, larger = eroded(_bladder(), 3.0, scene.step), dilated(_bladder(), 3.0, scene.step)
    assert dice(between(smaller, larger, scene.step), _bladder()) > 0.97
