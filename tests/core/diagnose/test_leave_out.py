"""Blocks of space that are left out in turn: how wide they are, and what lies in one."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.diagnose.detection.leave_out import blocks


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
