"""A step between slices is told from bones that moved as one, bent or were drawn with errors."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.core.observe.slice_step import slice_step


def _bones(seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Points (600, 3) mm on three spheres, and their design (600, 6)."""
    rng = np.random.default_rng(seed)
    normals = rng.normal(size=(600, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    centres = np.array([[-70.0, 0.0, 0.0], [70.0, 0.0, 0.0], [0.0, 60.0, 10.0]])
    points = 40.0 * normals + centres[np.arange(600) % 3]
    return points, np.hstack([normals, np.deg2rad(1.0) * np.cross(points, normals)])


def _left(design: FloatArray, distances: FloatArray) -> FloatArray:
    """What the best rigid motion leaves."""
    return np.asarray(distances - design @ np.linalg.lstsq(design, distances, rcond=None)[0])


def test_a_step_has_its_level_and_its_size() -> None:
    points, design = _bones()
    moved = np.where(points[:, 2] > 8.0, 1.0, 0.0)[:, None] * [3.0, -4.0, 0.0]
    noise = np.random.default_rng(2).normal(0.0, 0.2, 600)
    found = slice_step(points, design, _left(design, (moved * design[:, :3]).sum(axis=1) + noise))
    assert found.share > 0.8
    assert found.aside_mm == pytest.approx(5.0, abs=0.3)
    assert found.level_mm == pytest.approx(8.0, abs=4.0)


def test_errors_of_contours_are_no_step() -> None:
    points, design = _bones()
    found = slice_step(points, design, _left(design, np.random.default_rng(3).normal(0.0, 0.5, 600)))
    assert found.share < 0.1
    assert found.aside_mm < 0.5  # 60 points lie beyond the last level


def test_a_bone_that_moved_by_itself_is_no_step_of_slices() -> None:
    points, design = _bones()
    moved = np.where(np.arange(600) % 3 == 1, 1.0, 0.0)[:, None] * [2.0, 4.0, 3.0]
    left = _left(design, (moved * design[:, :3]).sum(axis=1))
    assert np.abs(left).max() > 1.0
    assert slice_step(points, design, left).share < 0.3


def test_bones_that_fit_exactly_have_none() -> None:
    points, design = _bones()
    found = slice_step(points, design, np.zeros(600))
    assert (found.share, found.aside_mm) == (0.0, 0.0)
