"""What voxels make a surface err by: foretold from one label, against a ball that is voxelised elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.imaging.labels import RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces, wall_surface
from palpate.meshing.voxel_errors import DRAWS, organ_voxel_errors, wall_voxel_errors

RADIUS, SPACING = 16.0, np.array([1.0, 1.0, 3.0])


def ball(shift: np.ndarray) -> Volume:
    """A ball about the origin on a grid that is moved by a share (3,) of a voxel."""
    shape = np.ceil(2.0 * (RADIUS + 6.0) / SPACING).astype(int)
    affine = np.diag([*SPACING, 1.0])
    affine[:3, 3] = -0.5 * SPACING * (shape - 1) + shift * SPACING
    labels = Volume(np.zeros(shape, dtype=np.uint8), affine)
    inside = np.linalg.norm(labels.to_lps(np.indices(shape).reshape(3, -1).T.astype(float)), axis=1) < RADIUS
    return labels.with_array(inside.reshape(shape).astype(np.uint8))


def parts(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points of the upper cap, where the surface is parallel to the slices, and of the right side, where it is not."""
    direction = points / np.linalg.norm(points, axis=1, keepdims=True)
    return direction[:, 2] > 0.95, direction[:, 0] > 0.8


def test_the_spread_on_cap_and_side_is_that_of_a_ball_voxelised_elsewhere() -> None:
    labels, rng = ball(np.array([0.2, -0.1, 0.3])), np.random.default_rng(3)
    surface = organ_surfaces(labels).points
    draws = organ_voxel_errors(labels, surface)
    assert draws.shape == (DRAWS, len(surface))
    np.testing.assert_allclose(draws.mean(axis=0), 0.0, atol=1e-9)
    others = [organ_surfaces(ball(rng.uniform(-0.5, 0.5, 3))).points for _ in range(24)]
    for k, told in enumerate(draws[:, part].mean(axis=1).std() for part in parts(surface)):
        seen = np.std([(np.linalg.norm(other, axis=1) - RADIUS)[parts(other)[k]].mean() for other in others])
        assert 0.6 * seen < told < 1.6 * seen
    cap, side = (draws[:, part].std(axis=0).mean() for part in parts(surface))
    assert cap > 3.0 * side


def test_fine_voxels_err_less_and_no_organ_is_refused() -> None:
    coarse = ball(np.zeros(3))
    fine = Volume(np.repeat(coarse.array, 3, axis=2), coarse.affine @ np.diag([1.0, 1.0, 1.0 / 3.0, 1.0]))
    points = organ_surfaces(coarse).points
    assert organ_voxel_errors(fine, points, draws=8).std() < 0.5 * organ_voxel_errors(coarse, points, draws=8).std()
    with pytest.raises(InputError, match="no organ voxel"):
        organ_voxel_errors(coarse.with_array(np.zeros_like(coarse.array)), points)


def test_a_wall_errs_as_an_organ_of_its_shape() -> None:
    organ = ball(np.array([0.2, -0.1, 0.3]))
    wall = organ.with_array(np.where(organ.array > 0, RECTUM, SURROUNDING_TISSUE).astype(np.uint8))
    surface = wall_surface(wall, RECTUM).points
    draws = wall_voxel_errors(wall, RECTUM, surface, draws=6)
    np.testing.assert_allclose(draws, organ_voxel_errors(organ, surface, draws=6), atol=0.02)
    assert draws.std() > 0.02
