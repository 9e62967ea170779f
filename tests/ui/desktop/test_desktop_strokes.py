"""Corrections of labels: what brush, eraser, undo and the journal do to voxels, on an oblique and anisotropic grid."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from phantoms import affine, labels

from palpate.core.arrays import IntArray
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.labels.journal import Journal, content_hash, replay
from palpate.ui.desktop.session.labels.strokes import Corrections, Drag, Stroke, erased_to, footprint
from palpate.ui.pictures.planes import AXIAL, PLANES

CENTRE = np.array([-10.0, 24.0, -148.0])


def volumes(rotation_deg: float = 0.0) -> dict[str, Volume]:
    matrix = affine(rotation_deg)
    return {"rest": labels(matrix), "deformed": labels(matrix, push_mm=3.0)}


def disc(volume: Volume, radius: float = 5.0) -> IntArray:
    return footprint(volume, CENTRE, radius, AXIAL)


def test_ball_holds_every_voxel_within_the_radius_and_no_other() -> None:
    volume = volumes(20.0)["rest"]
    inside = footprint(volume, CENTRE, 7.0, None)
    index = np.stack(np.unravel_index(np.arange(volume.array.size), volume.array.shape), axis=1)
    away = np.linalg.norm(volume.to_lps(index.astype(float)) - CENTRE, axis=1)
    assert set(inside.tolist()) == set(np.flatnonzero(away <= 7.0).tolist())


@pytest.mark.parametrize("plane", PLANES)
def test_disc_stays_in_the_slice_that_is_seen(plane: object) -> None:
    volume = volumes()["rest"]
    index = np.stack(np.unravel_index(footprint(volume, CENTRE, 6.0, plane), volume.array.shape), axis=1)  # type: ignore[arg-type]
    normal = plane.normal  # type: ignore[attr-defined]
    assert len(np.unique(index[:, normal])) == 1 and len(index) > 5
    assert index[0, normal] == round(float(volume.to_index(CENTRE[None])[0, normal]))


def test_the_smallest_brush_still_paints_the_voxel_under_it() -> None:
    volume = volumes()["rest"]
    assert len(footprint(volume, CENTRE + 0.4, 0.01, AXIAL)) == 1


def test_a_brush_at_the_edge_of_the_grid_stays_inside() -> None:
    volume = volumes()["rest"]
    corner = volume.to_lps(np.zeros((1, 3)))[0]
    index = np.stack(np.unravel_index(footprint(volume, corner, 9.0, None), volume.array.shape), axis=1)
    assert index.min() == 0 and (index.max(axis=0) < 10).all()
    assert footprint(volume, corner - 500.0, 9.0, None).size == 0


def test_eraser_takes_only_the_chosen_label_and_leaves_tissue() -> None:
    corrections = Corrections(volumes())
    before = corrections.volumes["rest"].array.copy()
    drag = Drag(corrections, "rest", erased_to(1), only=1)
    drag.add(footprint(corrections.volumes["rest"], CENTRE, 30.0, None))
    drag.end()
    after = corrections.volumes["rest"].array
    assert not (after == 1).any() and (after == 2).sum() == (before == 2).sum() and (before == 1).any()
    assert (after[before == 1] == 3).all() and erased_to(3) == 0


def test_one_drag_is_one_undo_and_redo_makes_it_again() -> None:
    corrections = Corrections(volumes())
    array = corrections.volumes["rest"].array
    before = array.copy()
    drag = Drag(corrections, "rest", 5)
    for shift in (0.0, 3.0, 6.0):
        drag.add(footprint(corrections.volumes["rest"], CENTRE + [shift, 0, 0], 4.0, AXIAL))
    assert drag.end() is not None
    painted = array.copy()
    assert (painted == 5).sum() > 20
    corrections.undo()
    assert np.array_equal(array, before) and not corrections.can_undo
    corrections.redo()
    assert np.array_equal(array, painted) and not corrections.can_redo


def test_painting_what_is_there_already_is_no_stroke() -> None:
    corrections = Corrections(volumes())
    drag = Drag(corrections, "rest", 3)
    drag.add(footprint(corrections.volumes["rest"], CENTRE + [0, 0, 40.0], 2.0, AXIAL))
    assert drag.end() is None and not corrections.can_undo


def test_a_new_stroke_forgets_what_was_undone() -> None:
    corrections = Corrections(volumes())
    for label in (5, 6):
        drag = Drag(corrections, "rest", label)
        drag.add(disc(corrections.volumes["rest"]))
        drag.end()
        corrections.undo()
    drag = Drag(corrections, "rest", 4)
    drag.add(disc(corrections.volumes["rest"]))
    drag.end()
    assert not corrections.can_redo


def test_unsaved_follows_undo() -> None:
    corrections = Corrections(volumes())
    drag = Drag(corrections, "rest", 5)
    drag.add(disc(corrections.volumes["rest"]))
    drag.end()
    assert corrections.unsaved
    corrections.saved()
    assert not corrections.unsaved
    corrections.undo()
    assert corrections.unsaved
    corrections.redo()
    assert not corrections.unsaved


def test_a_scan_without_labels_cannot_be_painted() -> None:
    corrections = Corrections({})
    with pytest.raises(InputError, match="the rest scan has no labels yet; run Segment first"):
        corrections.paint("rest", np.array([1]), 1)


NOT_STROKES = (
    {},
    {"state": "x", "after": 1, "index": [1], "before": [1]},
    {"state": "rest", "after": 9, "index": [], "before": []},
)


@pytest.mark.parametrize("data", NOT_STROKES)
def test_what_is_no_stroke_is_refused(data: object) -> None:
    with pytest.raises((KeyError, ValueError), match=r"index|no stroke"):
        Stroke.from_dict(data)


# The journal


def hashes(found: dict[str, Volume]) -> dict[str, str]:
    return {state: content_hash(volume) for state, volume in found.items()}


class Session:
    """A window's life: corrections with their journal."""

    def __init__(self, path: Path, found: dict[str, Volume]) -> None:
        self.corrections, told = Corrections(found), hashes(found)
        self.again = replay(path, self.corrections, told)
        self.journal = Journal(path, ThreadPoolExecutor(1))
        if not self.again:
            self.journal.start_over(told)

    def draw(self, label: int, shift: float = 0.0) -> None:
        drag = Drag(self.corrections, "rest", label)
        drag.add(footprint(self.corrections.volumes["rest"], CENTRE + [shift, 0.0, 0.0], 4.0, None))
        stroke = drag.end()
        assert stroke is not None
        self.journal.stroke(stroke)

    def undo(self) -> None:
        self.corrections.undo()
        self.journal.act("undo")

    def save(self) -> dict[str, Volume]:
        self.journal.mark(hashes(self.corrections.volumes), self.journal.acts)
        self.corrections.saved()
        return {state: v.with_array(v.array.copy()) for state, v in self.corrections.volumes.items()}


def test_a_kill_loses_neither_strokes_nor_undo(tmp_path: Path) -> None:
    path = tmp_path / "desktop" / "edits.jsonl"
    first = Session(path, volumes())
    first.draw(5)
    saved = first.save()
    first.draw(6, 8.0)
    first.draw(4, 12.0)
    first.undo()
    wanted = first.corrections.volumes["rest"].array.copy()

    second = Session(path, saved)  # the first is never closed
    assert second.again and second.corrections.unsaved
    assert np.array_equal(second.corrections.volumes["rest"].array, wanted)
    assert second.corrections.can_redo
    second.corrections.undo()
    assert not second.corrections.unsaved
    second.corrections.undo()  # back before the save: undo outlives it
    assert np.array_equal(second.corrections.volumes["rest"].array, volumes()["rest"].array)


def test_strokes_drawn_while_saving_are_not_taken_as_saved(tmp_path: Path) -> None:
    path = tmp_path / "edits.jsonl"
    first = Session(path, volumes())
    first.draw(5)
    saved = {state: v.with_array(v.array.copy()) for state, v in first.corrections.volumes.items()}
    acts = first.journal.acts
    first.draw(6, 9.0)
    first.journal.mark(hashes(saved), acts)  # as the writing thread does, later
    second = Session(path, saved)
    assert second.corrections.unsaved
    assert np.array_equal(second.corrections.volumes["rest"].array, first.corrections.volumes["rest"].array)


def test_a_save_that_did_not_come_to_its_end_loses_nothing(tmp_path: Path) -> None:
    path = tmp_path / "edits.jsonl"
    first = Session(path, volumes())
    first.draw(5)
    first.save()  # the mark is written, the label file is not
    second = Session(path, volumes())
    assert second.corrections.unsaved
    assert np.array_equal(second.corrections.volumes["rest"].array, first.corrections.volumes["rest"].array)


def test_a_line_that_was_cut_is_passed_over(tmp_path: Path) -> None:
    path = tmp_path / "edits.jsonl"
    first = Session(path, volumes())
    first.draw(5)
    whole = first.corrections.volumes["rest"].array.copy()
    first.draw(6, 9.0)
    path.write_bytes(path.read_bytes()[:-40])
    second = Session(path, volumes())
    assert np.array_equal(second.corrections.volumes["rest"].array, whole)
    second.draw(4, -9.0)
    third = Session(path, volumes())
    assert np.array_equal(third.corrections.volumes["rest"].array, second.corrections.volumes["rest"].array)


def test_strokes_on_other_labels_are_set_aside(tmp_path: Path) -> None:
    path = tmp_path / "edits.jsonl"
    Session(path, volumes()).draw(5)
    other = volumes(10.0)
    other["rest"].array[0, 0, 0] ^= 1
    second = Session(path, other)
    assert not second.again and not second.corrections.unsaved
    kept = (tmp_path / "edits_of_earlier_labels.jsonl").read_text().splitlines()
    assert any("stroke" in json.loads(line) for line in kept)
