"""Bladders that fat does not bound, or that hold next to nothing, are found; what looks like one and is not, is not taken."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from scipy import ndimage

from palpate.segmentation.bladder.bladder import find_bladder
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Scene, make_scene
from palpate.segmentation.working_grid import Mask, blurred, mask_on
from palpate.validate.segmentation.contoured_scan import phantom_scan
from palpate.validate.segmentation.dice import dice
from palpate.validate.segmentation.variants import Recipe, variant_of

FAT_HU, WALL_HU, URINE_HU, WALL_MM = -100.0, 40.0, 5.0, 2.5


def test_a_bladder_without_fat_about_it_is_found_and_not_the_muscle_in_front_of_it() -> None:
    variant = variant_of(
        phantom_scan(),
        Recipe(slice_mm=3.0, kernel_mm=-0.42, offset_hu=1.9, above_mm=40.0, mirrored=True, fat=0.0),
        seed=1,
    )
    scene = make_scene(variant.ct)
    bladder = find_bladder(scene, Prompts())
    assert bladder is not None
    assert dice(np.asarray(bladder.mask), mask_on(variant.masks["bladder"], scene.grid)) > 0.8


def test_a_bladder_of_nine_cc_is_found_where_it_is_and_doubted() -> None:
    """Its wall is drawn too near: only its place is asked for."""
    scene, true = nearly_empty(9.0)
    bladder = find_bladder(scene, Prompts())
    assert bladder is not None
    assert (np.asarray(bladder.mask) & true).sum() > 0.8 * bladder.mask.sum()
    assert bladder.confidence < 0.3


def test_a_bladder_of_twenty_cc_is_found_whole() -> None:
    scene, true = nearly_empty(20.0)
    bladder = find_bladder(scene, Prompts())
    assert bladder is not None
    assert dice(np.asarray(bladder.mask), true) > 0.85


def test_a_bladder_as_dense_as_muscle_is_found_by_the_fat_about_it() -> None:
    scene, bladder = full()
    contents = ndimage.distance_transform_edt(bladder, sampling=scene.step) > 1.5
    noise = np.random.default_rng(1).normal(0.0, 8.0, contents.shape)
    hu = np.where(contents, scene.muscle + noise, scene.hu).astype(np.float32)
    found = find_bladder(replace(scene, hu=hu, filled=np.where(contents, hu, scene.filled)), Prompts())
    assert found is not None
    assert dice(np.asarray(found.mask), bladder) > 0.8


@cache
def full() -> tuple[Scene, Mask]:
    """The phantom's scene and its bladder."""
    scan = phantom_scan()
    scene = make_scene(scan.ct)
    return scene, mask_on(scan.masks["bladder"], scene.grid)


def nearly_empty(cc: float) -> tuple[Scene, Mask]:
    """The phantom's scene with what is deepest in its bladder as all of it, with a wall and fat about it; and its mask."""
    scene, bladder = full()
    depth = ndimage.distance_transform_edt(bladder, sampling=scene.step)
    least = np.sort(depth[bladder])[-round(1000.0 * cc / scene.step**3)]
    true = depth >= least
    region = ndimage.binary_dilation(bladder, iterations=1)
    noise = np.random.default_rng(1).normal(0.0, 8.0, true.shape)
    inner = ndimage.distance_transform_edt(true, sampling=scene.step) > WALL_MM
    hu = np.where(true, np.where(inner, URINE_HU, WALL_HU), FAT_HU)
    soft = blurred(np.where(region, hu, scene.hu), 0.8, scene.step) + noise
    changed = np.where(region, soft, scene.hu).astype(np.float32)
    return replace(scene, hu=changed, filled=np.where(region, changed, scene.filled).astype(np.float32)), true
