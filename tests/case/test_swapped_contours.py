"""Exchanged contours are noticed by the grey values where the two outlines differ, and right ones raise no alarm."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.case.swapped_contours import swapped_note
from palpate.core.arrays import BoolArray
from palpate.imaging.labels import BLADDER, PROSTATE_LEFT, RECTUM
from palpate.imaging.volume import Volume

GRID = np.diag([1.5, 1.5, 2.0, 1.0])
SHIFT = np.eye(4)
SHIFT[:3, 3] = (7.0, -4.0, 11.0)


def ball(shape: tuple[int, ...], centre: tuple[float, ...], radius: float) -> BoolArray:
    index = np.moveaxis(np.indices(shape), 0, -1) * np.diag(GRID)[:3]
    return np.linalg.norm(index - np.array(centre), axis=-1) < radius


def state(bladder_radius: float, gas: float, seed: int, moved: bool = False) -> tuple[Volume, Volume]:
    """A scan and its labels: bladder of water, rectum of gas or stool, prostate, in fat, with noise of 15 HU."""
    shape = (60, 60, 40)
    labels = np.zeros(shape, dtype=np.uint8)
    labels[ball(shape, (45.0, 40.0, 52.0), bladder_radius)] = BLADDER
    labels[ball(shape, (45.0, 65.0, 30.0), 10.0 + 0.2 * bladder_radius)] = RECTUM
    labels[ball(shape, (45.0, 43.0, 20.0), 12.0)] = PROSTATE_LEFT
    hu = np.choose(labels, [-90.0, 45.0, 45.0, -90.0, 300.0, 8.0, gas])
    hu = hu + np.random.default_rng(seed).normal(0.0, 15.0, shape)
    affine = np.linalg.inv(SHIFT) @ GRID if moved else GRID
    return Volume(hu, affine), Volume(labels, affine)


@pytest.mark.parametrize("gas", [-800.0, 30.0])
def test_right_contours_pass_and_exchanged_ones_are_named(gas: float) -> None:
    (ct_a, labels_a), (ct_b, labels_b) = state(14.0, 30.0, 1), state(18.0, gas, 2, moved=True)
    scans = {"rest": ct_a, "deformed": ct_b}
    assert swapped_note(scans, {"rest": labels_a, "deformed": labels_b}, SHIFT) is None
    exchanged = {"rest": labels_b.moved(SHIFT), "deformed": labels_a.moved(np.linalg.inv(SHIFT))}
    note = swapped_note(scans, exchanged, SHIFT)
    assert note is not None and "contours look exchanged" in note


def test_outlines_that_hardly_differ_tell_nothing() -> None:
    (ct_a, labels), (ct_b, _) = state(14.0, 30.0, 1), state(14.0, 30.0, 2)
    assert swapped_note({"rest": ct_a, "deformed": ct_b}, {"rest": labels, "deformed": labels}, np.eye(4)) is None


def test_contours_of_one_scan_alone_tell_nothing() -> None:
    (ct_a, labels), (ct_b, _) = state(14.0, 30.0, 1), state(18.0, 30.0, 2)
    assert swapped_note({"rest": ct_a, "deformed": ct_b}, {"rest": labels}, np.eye(4)) is None


def emptied(radius: float, seed: int) -> tuple[Volume, Volume]:
    """A rectum of this radius full of gas within a wall of 2 mm; prostate and bladder are the same in every state."""
    shape = (60, 60, 40)
    _, labels = state(14.0, 30.0, seed)
    array = np.where(labels.array == RECTUM, 0, labels.array).astype(np.uint8)
    rectum, gas = (ball(shape, (45.0, 65.0, 30.0), r) for r in (radius, radius - 2.0))
    array[rectum] = RECTUM
    hu = np.choose(array, [-90.0, 45.0, 45.0, -90.0, 300.0, 8.0, 40.0])
    hu[gas] = -900.0
    return Volume(hu + np.random.default_rng(seed).normal(0.0, 15.0, shape), GRID), Volume(array, GRID)


def test_gas_outside_its_own_outline_tells_where_nothing_else_does() -> None:
    (full, wide), (empty, narrow) = emptied(13.0, 1), emptied(9.0, 2)
    scans = {"rest": full, "deformed": empty}
    assert swapped_note(scans, {"rest": wide, "deformed": narrow}, np.eye(4)) is None
    note = swapped_note(scans, {"rest": narrow, "deformed": wide}, np.eye(4))
    assert note is not None and "contours look exchanged" in note
