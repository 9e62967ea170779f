"""Organs found in the phantom's CT, against its analytic truth."""

from __future__ import annotations

import numpy as np
import pytest
from organ_scans import found, scan, truth, truth_of

from palpate.core.errors import InputError
from palpate.imaging.labels import BLADDER, BONE, RECTUM
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import wall_surface
from palpate.segmentation.bladder.bladder import find_bladder
from palpate.segmentation.pelvis import segment_pelvis
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.prostate.prostate import find_prostate
from palpate.simulate.phantom import anatomy, phantom
from palpate.validate.segmentation.dice import click_of, dice

LABELS = {"prostate": (1, 2), "bladder": (BLADDER,), "rectum": (RECTUM,)}
SOLIDS = {
    "prostate": anatomy.PROSTATE,
    "bladder": anatomy.BLADDER,
    "rectum": anatomy.RECTUM,
}


@pytest.mark.parametrize("organ", ["prostate", "bladder"])
def test_dice_against_truth(organ: str) -> None:
    mask = found().mask(organ, truth())
    assert dice(mask, truth_of(*LABELS[organ]).array) > 0.965


@pytest.mark.parametrize("organ", ["prostate", "bladder", "rectum"])
def test_outer_surface_is_within_four_tenths_of_a_millimetre(organ: str) -> None:
    grid = found().scene.grid
    surface = wall_surface(grid.with_array(np.where(found().organs[organ].mask, 6, 3).astype(np.uint8)), 6)
    points = surface.points - phantom.ORIGIN_MM
    # The rectum's ends are where it was cut off, not walls.
    inner = np.abs(points[:, 2]) < (30.0 if organ == "rectum" else np.inf)
    error = SOLIDS[organ].distance(points[inner])
    assert np.sqrt(np.mean(error**2)) < 0.45
    assert abs(error.mean()) < 0.25


def test_bone_holds_all_true_bone_and_little_else() -> None:
    mask, true = found().mask("bone", truth()), truth_of(BONE).array
    assert (mask & true).sum() / true.sum() > 0.99
    assert dice(mask, true) > 0.88


def test_body_leaves_out_the_table() -> None:
    body = found().scene.body
    y = found().scene.axes()[1].ravel() - phantom.ORIGIN_MM[1]
    behind = body[:, y > 118.0]
    assert behind.size == 0 or behind.mean() < 0.02


def test_confidence_is_high_where_the_picture_is_clear() -> None:
    assert all(organ.confidence > 0.6 for organ in found().organs.values())
    assert {organ.method for organ in found().organs.values()} == {"auto"}


def test_landmarks_tell_left_from_right() -> None:
    pelvis = found().scene.pelvis
    assert pelvis.reliable
    assert pelvis.normal[0] > 0.99
    middle = pelvis.symphysis.mean(axis=0)
    assert abs(middle[0] - phantom.ORIGIN_MM[0]) < 8.0
    assert pelvis.sacrum[:, 1].mean() > middle[1] + 80.0


def test_a_click_off_the_centre_gives_the_same_prostate() -> None:
    scene, organs = found().scene, found().organs
    point = click_of(truth_of(1, 2)) + np.array([4.0, -3.0, 3.0])
    again = find_prostate(scene, Prompts({"prostate": point}), organs["bladder"].mask, organs["rectum"].mask)
    assert again is not None
    assert again.method == "click"
    assert dice(again.mask, organs["prostate"].mask) > 0.93


def test_a_click_on_the_bladder_gives_the_same_bladder() -> None:
    again = find_bladder(found().scene, Prompts({"bladder": click_of(truth_of(BLADDER))}))
    assert again is not None
    assert dice(again.mask, found().organs["bladder"].mask) > 0.95


def test_drawn_organs_are_taken_as_they_are() -> None:
    grid = found().scene.grid
    drawn = grid.with_array(np.roll(found().organs["prostate"].mask, 4, axis=0))
    kept = {name: grid.with_array(organ.mask) for name, organ in found().organs.items() if name != "prostate"}
    result = segment_pelvis(scan(), drawn={**kept, "prostate": drawn})
    assert result.organs["prostate"].method == "user"
    assert np.array_equal(result.organs["prostate"].mask, drawn.array)


def test_a_scan_of_air_is_refused() -> None:
    air = Volume(np.full((60, 60, 30), -1000, dtype=np.int16), np.diag([3.0, 3.0, 3.0, 1.0]))
    with pytest.raises(InputError, match="holds no body"):
        segment_pelvis(air)


def test_a_body_without_bone_is_refused() -> None:
    soft = np.full((70, 60, 40), -1000, dtype=np.int16)
    soft[8:-8, 8:-8] = 40
    with pytest.raises(InputError, match="hardly any bone"):
        segment_pelvis(Volume(soft, np.diag([3.0, 3.0, 3.0, 1.0])))


@pytest.mark.parametrize("away", [(0.0, 60.0, 0.0), (30.0, 20.0, -40.0), (400.0, 0.0, 0.0)])
def test_a_click_beside_the_bladder_ends_in_a_bladder_or_in_none(away: tuple[float, float, float]) -> None:
    point = click_of(truth_of(BLADDER)) + np.array(away)
    wrong = find_bladder(found().scene, Prompts({"bladder": point}))
    assert wrong is None or (wrong.mask.any() and 0.0 <= wrong.confidence <= 1.0)


def test_a_box_around_next_to_nothing_holds_no_bladder() -> None:
    corner = click_of(truth_of(BLADDER))
    tiny = find_bladder(found().scene, Prompts(boxes={"bladder": np.array([corner, corner + 6.0])}))
    assert tiny is None or tiny.mask.sum() * found().scene.step ** 3 < 1000.0
