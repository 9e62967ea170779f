"""Blocks of space that are left out in turn: how wide they are, and what lies in one."""

from __future__ import annotations

import numpy as np
import pytest
from organ_case import organ_case

from palpate.core.diagnose.decision_rules import DecisionRules
from palpate.core.diagnose.detection.leave_out import blocks, data_split
from palpate.core.inference.heldout import Split
from palpate.core.observe.motion_rows import motion_in_mm
from palpate.core.residual.plain_fit import PlainFit


@pytest.mark.parametrize("width", [14.0, 24.0])
def test_blocks_are_as_wide_as_asked_and_hold_every_point(width: float) -> None:
    points = np.random.default_rng(0).uniform(-30.0, 30.0, (400, 3))
    found = blocks(points, width)
    assert set(found) == set(range(found.max() + 1)) and found.max() > 3
    for one in range(found.max() + 1):
        inside = points[found == one]
        assert np.linalg.norm(inside - inside[:, None], axis=2).max() <= 2.0 * width
    centres = np.array([points[found == one].mean(axis=0) for one in range(found.max() + 1)])
    apart = np.linalg.norm(centres - centres[:, None], axis=2) + 1e3 * np.eye(len(centres))
    assert apart.min() > 0.5 * width


def test_surface_and_motion_at_one_place_are_left_out_together() -> None:
    """Rows of one place, whatever they show of it, share their block."""
    places = np.random.default_rng(1).uniform(-30.0, 30.0, (80, 3))
    found = blocks(np.vstack([places, np.repeat(places, 3, axis=0)]), 24.0)
    np.testing.assert_array_equal(np.repeat(found[:80], 3), found[80:])


RULES = DecisionRules()


@pytest.mark.parametrize(("drawn", "images"), [(True, True), (True, False), (False, True)])
def test_the_rows_are_surface_then_motion_inside_then_motion_around(drawn: bool, images: bool) -> None:
    fit = organ_case(drawn=drawn, images=images)
    split, data, r = data_split(fit, RULES), fit.model.data_vectors[0], fit.linearisation.residual
    kinds = ["surface"] * drawn + ["inside", "tissue"] * images
    assert list(split.parts) == kinds
    assert [part.start for part in split.parts.values()] == [0, *(part.stop for part in split.parts.values())][:-1]
    read = split.reader @ r
    if drawn:
        along = data.modes @ r[: data.n_modes]
        assert np.isin(np.round(read[split.parts["surface"]], 9), np.round(along, 9)).all()
    if images:
        seen = fit.linearisation.first.scene.observation.motion
        missed = np.einsum("wam,m->wa", motion_in_mm(seen.rows, seen.reader), r[data.motion])
        for kind in ("inside", "tissue"):
            assert np.isin(np.round(read[split.parts[kind]], 9), np.round(missed, 9)).all()


def test_motion_is_inside_where_a_cell_of_the_organ_holds_it() -> None:
    fit = organ_case()
    split, data = data_split(fit, RULES), fit.model.data_vectors[0]
    seen = fit.linearisation.first.scene.observation.motion
    read = motion_in_mm(seen.rows, seen.reader)
    radius = np.linalg.norm(seen.rows.places, axis=1)
    found: dict[str, list[float]] = {}
    for kind in ("inside", "tissue"):
        rows = split.reader[split.parts[kind], data.motion]
        which = [int(np.argmin(np.abs(read[:, 0] - row).max(axis=1))) for row in rows[::3]]
        found[kind] = radius[which].tolist()
    assert max(found["inside"]) < 10.1 and min(found["tissue"]) > 8.0
    assert 0 < len(found["inside"]) < len(found["tissue"])


def test_landmarks_are_one_block_of_their_own_and_bones_are_never_left_out() -> None:
    fit = organ_case(marks=2, bone=True)
    split = data_split(fit, RULES)
    known = sum(part.stop - part.start for part in split.parts.values())
    assert (split.patch[:known] >= 0).all()
    last = split.patch[: known + 6].max()
    assert split.patch[known:].tolist() == [last] * 6 + [-1] * 6
    assert last == split.patch[:known].max() + 1
    assert split.n_patches == last + 1
    data = fit.model.data_vectors[0]
    kept = [*range(data.marks.start, data.marks.stop), *range(data.motion.stop, data.n)]
    np.testing.assert_array_equal(split.reader[known:], np.eye(data.n)[kept])
    without = data_split(organ_case(marks=0, bone=False), RULES)
    assert len(without.patch) == sum(part.stop - part.start for part in without.parts.values())
    assert (without.patch >= 0).all()


def test_only_what_is_read_at_points_has_an_error_of_its_own() -> None:
    fit = organ_case()
    split = data_split(fit, RULES)
    known = sum(part.stop - part.start for part in split.parts.values())
    own = split.covariance - split.reader @ fit.weighting.covariance @ split.reader.T
    np.testing.assert_allclose(own, np.diag([fit.options.patch_nugget_mm**2] * known + [0.0] * 12), atol=1e-12)


def places_of(fit: PlainFit, split: Split) -> np.ndarray:
    """Positions (k, 3) mm of the rows that are read at places, by what they read."""
    data, observation = fit.model.data_vectors[0], fit.linearisation.first.scene.observation
    known = max(part.stop for part in split.parts.values())
    rows, seen = split.reader[:known], observation.motion
    every, at = [np.pad(data.modes, ((0, 0), (0, data.n - data.n_modes)))], [observation.points]
    if data.n_motion:
        read = motion_in_mm(seen.rows, seen.reader).reshape(-1, data.n_motion)
        every.append(np.pad(read, ((0, 0), (data.motion.start, data.n - data.motion.stop))))
        at.append(np.repeat(seen.rows.places, 3, axis=0))
    nearest = np.abs(rows[:, None] - np.vstack(every)).max(axis=2).argmin(axis=1)
    return np.vstack(at)[nearest]


@pytest.mark.parametrize(("images", "width"), [(False, 14.0), (True, 24.0)])
def test_blocks_are_two_lengths_of_noise_or_of_matching_wide(images: bool, width: float) -> None:
    fit = organ_case(images=images)
    split = data_split(fit, RULES)
    at = places_of(fit, split)
    np.testing.assert_array_equal(split.patch[: len(at)], blocks(at, width))
    assert split.patch[: len(at)].max() >= 1


def test_points_are_as_far_apart_as_asked() -> None:
    for spacing in (4.0, 9.0):
        fit = organ_case(images=False)
        at = places_of(fit, data_split(fit, DecisionRules(point_spacing_mm=spacing)))
        every = fit.linearisation.first.scene.observation.points
        assert len(at) == len({tuple(cube) for cube in np.floor(every / spacing).astype(int).tolist()})
        assert len(at) < len(every)


def test_motion_is_foretold_near_the_organ_only() -> None:
    fit = organ_case()
    seen = fit.linearisation.first.scene.observation
    gap = np.linalg.norm(seen.motion.rows.places[:, None] - seen.points, axis=2).min(axis=1)
    for reach in (0.0, 5.0, 15.0):
        split = data_split(fit, DecisionRules(near_mm=reach))
        at = places_of(fit, split)[split.parts["surface"].stop :]
        told = np.linalg.norm(at[:, None] - seen.points, axis=2).min(axis=1)
        assert (
            len(told) and told.max() <= max(reach, gap.min()) + 1e-9
        )  # where all of it is far, the nearest stands for it
        if reach > gap.min():
            assert told.max() > 0.5 * reach
