"""Editing of a whole label: shapes whose answer is known; other organs are left alone; one undo takes all back."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from map_arrays import map_arrays
from phantoms import CENTRE

from palpate.imaging.labels import BLADDER, PROSTATE_LEFT, PROSTATE_RIGHT, RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.desktop.panels.job_panel import time_words
from palpate.ui.desktop.session.jobs import JobState
from palpate.ui.desktop.session.labels.label_operations import OPERATIONS, changed_label, values_at
from palpate.ui.desktop.session.labels.label_statistics import MapStatistics, label_statistics
from palpate.ui.desktop.session.labels.strokes import Corrections, Stroke
from palpate.ui.desktop.session.map_values import map_at
from palpate.ui.desktop.slices.slice_sampling import numbered
from palpate.ui.pictures.planes import AXIAL, SAGITTAL

SPACING = np.array([1.0, 1.5, 2.0])


def ball(radius: float = 9.0) -> Volume:
    """A ball of prostate in tissue, a bladder that touches it above."""
    affine = np.diag([*SPACING, 1.0])
    grid = np.stack(np.meshgrid(*map(np.arange, (40, 30, 24)), indexing="ij"), axis=-1) * SPACING
    away = np.linalg.norm(grid - [20.0, 22.0, 22.0], axis=-1)
    array = np.where(away < radius, PROSTATE_LEFT, SURROUNDING_TISSUE).astype(np.uint8)
    array[:, :, 16:][away[:, :, 16:] >= radius] = BLADDER
    return Volume(array, affine)


def after(volume: Volume, operation: str, amount: float = 0.0, label: int = PROSTATE_LEFT) -> Volume:
    stroke = changed_label(volume, "rest", label, operation, amount)
    assert stroke is not None
    changed = volume.with_array(volume.array.copy())
    Corrections({"rest": changed}).make(Stroke.from_dict(stroke.to_dict()))
    return changed


def cc(volume: Volume, label: int = PROSTATE_LEFT) -> float:
    return float((volume.array == label).sum() * np.prod(SPACING) / 1000.0)


def test_slices_between_drawn_ones_of_a_cone_are_those_of_the_cone() -> None:
    """Its radius grows evenly from slice to slice, which is what the interpolation assumes."""
    whole = ball()
    across, back, slices = np.indices(whole.array.shape)
    wide = np.hypot(across - 20.0, 1.5 * back - 22.0) < 4.0 + 0.6 * slices
    whole.array[:] = np.where(wide & (slices > 3) & (slices < 18), PROSTATE_LEFT, SURROUNDING_TISSUE)
    holes = whole.with_array(whole.array.copy())
    for k in (9, 10, 12):
        holes.array[:, :, k][holes.array[:, :, k] == PROSTATE_LEFT] = SURROUNDING_TISSUE
    filled = after(holes, "fill between slices")
    drawn = filled.array == PROSTATE_LEFT
    wanted = whole.array == PROSTATE_LEFT
    assert 2.0 * (drawn & wanted).sum() / (drawn.sum() + wanted.sum()) > 0.99


@pytest.mark.parametrize(("operation", "sign"), [("grow", 1.0), ("shrink", -1.0)])
def test_growing_and_shrinking_move_the_outline_by_the_distance(operation: str, sign: float) -> None:
    free = ball()
    free.array[free.array == BLADDER] = SURROUNDING_TISSUE
    radius = (cc(after(free, operation, 3.0)) * 1000.0 * 0.75 / np.pi) ** (1 / 3)
    assert radius == pytest.approx((cc(free) * 1000.0 * 0.75 / np.pi) ** (1 / 3) + sign * 3.0, abs=0.6)


def test_no_operation_takes_from_another_organ() -> None:
    volume = ball()
    for operation in OPERATIONS:
        stroke = changed_label(volume, "rest", PROSTATE_LEFT, operation, 4.0)
        if stroke is not None:
            assert BLADDER not in stroke.before, operation


def test_islands_go_and_spikes_are_smoothed() -> None:
    volume = ball()
    volume.array[1:3, 1:3, 1:3] = PROSTATE_LEFT
    assert not (after(volume, "keep the largest piece").array[1:3, 1:3, 1:3] == PROSTATE_LEFT).any()
    spike = ball()
    spike.array[20:38, 14, 10] = PROSTATE_LEFT
    smooth = after(spike, "smooth")
    assert not (smooth.array[32:38, 14, 10] == PROSTATE_LEFT).any()
    assert cc(smooth) == pytest.approx(cc(ball()), rel=0.05)


def test_one_undo_takes_an_operation_back_and_nothing_to_change_is_none() -> None:
    volume = ball()
    before = volume.array.copy()
    corrections = Corrections({"rest": volume})
    stroke = changed_label(volume, "rest", PROSTATE_LEFT, "smooth", 3.0)
    assert stroke is not None
    corrections.make(stroke)
    assert (volume.array != before).any()
    corrections.undo()
    assert np.array_equal(volume.array, before)
    assert changed_label(volume, "rest", RECTUM, "grow", 3.0) is None
    assert changed_label(volume, "rest", PROSTATE_LEFT, "keep the largest piece", 0.0) is None
    with pytest.raises(ValueError, match="no stroke"):
        Stroke.from_dict(stroke.to_dict() | {"after": [99] * len(stroke.index)})


def test_statistics_are_those_of_the_label_in_its_scan() -> None:
    labels = ball()
    ct = Volume(np.where(labels.array == PROSTATE_LEFT, 40.0, -100.0).astype(np.float32), labels.affine)
    (prostate, bladder) = label_statistics(labels, ct, ())
    assert (prostate.label, bladder.label) == (PROSTATE_LEFT, BLADDER)
    assert prostate.volume_cc == pytest.approx(cc(labels)) and prostate.mean_hu == 40.0 and prostate.sd_hu == 0.0
    beyond = ct.with_array(ct.array[:, :, :2])
    assert np.isnan(values_at(beyond, labels, np.array([labels.array.size - 1]))).all()


def test_statistics_of_the_map_are_those_under_the_label() -> None:
    """Two patches, 20 kPa on the left and 60 on the right, of which one is told; a ball around each."""
    centre = np.array(CENTRE, dtype=float)
    affine = np.eye(4)
    affine[:3, 3] = centre - [20.0, 10.0, 10.0]
    grid = np.stack(np.meshgrid(*map(np.arange, (41, 21, 21)), indexing="ij"), axis=-1) + affine[:3, 3]
    array = np.zeros(grid.shape[:3], dtype=np.uint8)
    for label, side in ((PROSTATE_LEFT, 9.0), (PROSTATE_RIGHT, -9.0)):
        array[np.linalg.norm(grid - centre - [side, 0.0, 0.0], axis=-1) < 2.0] = label
    left, right = label_statistics(Volume(array, affine), None, (), map_arrays(told_left=False))
    assert left.mapped == MapStatistics(0.0, None, None, None)
    assert right.mapped is not None and right.mapped.told_share == 1.0
    G, _ = map_at(map_arrays(told_left=False), centre[None] - [[9.0, 0.0, 0.0]], None, np.array([PROSTATE_RIGHT]))
    three = [right.mapped.low, right.mapped.median, right.mapped.high]
    assert three == pytest.approx([60.0] * 3) and G[0] == pytest.approx(60.0), (
        "one place in a half has the half's value"
    )


def test_slices_are_counted_from_one_along_the_patients_axis() -> None:
    volume = ball()
    assert [numbered(volume, AXIAL, z) for z in (0.0, 0.9, 1.1, 46.0, 47.1)] == [
        (1, 24), (1, 24), (2, 24), (24, 24), None,
    ]  # fmt: skip
    assert numbered(volume, SAGITTAL, 12.0) == (13, 40)


def test_the_time_left_never_grows_and_says_so_when_it_was_too_short() -> None:
    state = JobState("x", 100.0, step_began=100.0, step_fraction=0.5)
    told = [state.seconds_left(110.0)]
    for now, fraction in ((112.0, 0.5), (125.0, 0.55), (140.0, 0.6)):
        state.step_fraction = fraction
        told.append(state.seconds_left(now))
    assert told[0] == pytest.approx(10.0) and all(b <= a for a, b in pairwise(told))
    assert time_words(40.0, told[-1], False) == "40 s so far, longer than was thought"
    assert time_words(300.0, 90.0, False) == "5 min so far, about 2 min left"
    assert time_words(20.0, None, True) == "took 20 s"
