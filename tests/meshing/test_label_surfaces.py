"""Surfaces cut from voxels against the analytic shapes the voxels were made of."""

from __future__ import annotations

import numpy as np
import pytest
from voxel_shapes import FloatArray, ball, distance, grid, paint, prostate, tube

from palpate.core.errors import InputError
from palpate.core.surfaces.surface import Surface
from palpate.imaging.volume import Volume
from palpate.meshing.extend_labels import crop, extend_labels, without_specks
from palpate.meshing.label_surfaces import organ_surfaces, wall_surface

HALF = (32.0, 28.0, 30.0)


def organ_labels(spacing: tuple[float, float, float], seed: int) -> Volume:
    shift = np.random.default_rng(seed).uniform(-0.5, 0.5, 3) * spacing
    labels = paint(grid(spacing, HALF, shift), prostate, 1)
    right = labels.to_lps(np.indices(labels.array.shape).reshape(3, -1).T.astype(float))[:, 0] < 2.0
    return labels.with_array(
        np.where((labels.array == 1) & right.reshape(labels.array.shape), 2, labels.array).astype(np.uint8)
    )


def errors(surface: Surface) -> FloatArray:
    """Distances from the prostate at face centres, each face counting by its area."""
    pick = np.random.default_rng(0).choice(len(surface.faces), 4000, p=surface.areas / surface.areas.sum())
    return distance(prostate, surface.points[surface.faces[pick]].mean(axis=1))


@pytest.mark.parametrize(
    ("spacing", "bias_mm", "rms_mm"),
    [((1.0, 1.0, 2.0), 0.04, 0.10), ((1.0, 1.0, 3.0), 0.04, 0.13), ((1.2, 1.2, 1.5), 0.04, 0.10)],
)
def test_organ_surface_is_where_the_organ_is(
    spacing: tuple[float, float, float], bias_mm: float, rms_mm: float
) -> None:
    found = np.concatenate([errors(organ_surfaces(organ_labels(spacing, seed))) for seed in range(3)])
    assert abs(found.mean()) < bias_mm
    assert found.std() < rms_mm


def test_bias_is_the_same_in_two_states() -> None:
    """The same organ at two places on two grids: what is left of the mean distance cancels."""
    rest = errors(organ_surfaces(organ_labels((1.0, 1.0, 2.0), 1))).mean()
    moved = errors(organ_surfaces(organ_labels((1.1, 1.0, 2.5), 2))).mean()
    assert abs(rest - moved) < 0.03


def test_no_terraces() -> None:
    """Normals vary smoothly: on terraces they jump between the axis and the plane of the slices."""
    surface = organ_surfaces(organ_labels((1.0, 1.0, 3.0), 0))
    centres = surface.points[surface.faces].mean(axis=1)
    step = 1e-3
    slope = np.stack([prostate(centres + step * e) - prostate(centres - step * e) for e in np.eye(3)], axis=1)
    slope /= np.linalg.norm(slope, axis=1, keepdims=True)
    angle = np.degrees(np.arccos(np.clip((slope * surface.face_normals).sum(axis=1), -1.0, 1.0)))
    assert np.average(angle, weights=surface.areas) < 5.0


def test_normals_point_out_and_volume_is_right() -> None:
    labels = organ_labels((1.0, 1.0, 2.0), 0)
    surface = organ_surfaces(labels)
    voxels = float((labels.array > 0).sum() * np.prod(labels.spacing))
    assert surface.enclosed_volume == pytest.approx(voxels, rel=0.01)
    assert (np.einsum("ij,ij->i", surface.point_normals, surface.points) > 0.0).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_grid_gives_the_same_surface(axis: int) -> None:
    labels = organ_labels((1.0, 1.0, 2.0), 0)
    affine = labels.affine.copy()
    affine[:3, 3] += affine[:3, axis] * (labels.array.shape[axis] - 1)
    affine[:3, axis] *= -1.0
    mirrored = organ_surfaces(Volume(np.flip(labels.array, axis), affine))
    surface = organ_surfaces(labels)
    assert mirrored.enclosed_volume == pytest.approx(surface.enclosed_volume, rel=1e-3)
    assert mirrored.points.mean(axis=0) == pytest.approx(surface.points.mean(axis=0), abs=0.05)


def test_regions_meet_on_the_dividing_plane() -> None:
    surface = organ_surfaces(organ_labels((1.0, 1.0, 2.0), 0))
    x = surface.points[surface.faces].mean(axis=1)[:, 0]
    assert (surface.region[x > 3.5] == 1).all()
    assert (surface.region[x < 0.5] == 2).all()
    assert len(surface.rim) > 50
    assert np.abs(surface.points[surface.rim, 0] - 2.0).max() < 1.6


def test_part_keeps_the_faces_of_one_region() -> None:
    surface = organ_surfaces(organ_labels((1.0, 1.0, 2.0), 0))
    left, right = surface.part(1), surface.part(2)
    assert len(left.faces) + len(right.faces) == len(surface.faces)
    assert left.areas.sum() + right.areas.sum() == pytest.approx(surface.areas.sum())
    assert right.points[:, 0].max() < 4.0


def test_one_organ_label_is_one_region_without_rim() -> None:
    labels = paint(grid((1.0, 1.0, 2.0), HALF, np.zeros(3)), prostate, 1)
    surface = organ_surfaces(labels)
    assert set(surface.region) == {1}
    assert len(surface.rim) == 0


def test_no_organ_is_an_input_error() -> None:
    with pytest.raises(InputError, match="no organ voxel"):
        organ_surfaces(grid((1.0, 1.0, 2.0), HALF, np.zeros(3)))


def boxed_tube(spacing: tuple[float, float, float]) -> Volume:
    """A tube that leaves the modelled box through two faces, with four voxels of outside all around."""
    labels = grid(spacing, (26.0, 26.0, 34.0), np.array([0.2, -0.3, 0.4]))
    array = paint(labels.with_array(labels.array + 3), tube(9.0), 6).array
    return labels.with_array(np.pad(array[4:-4, 4:-4, 4:-4], 4))


def test_a_tube_runs_through_the_faces_of_the_box() -> None:
    labels = boxed_tube((1.0, 1.0, 2.0))
    wall = wall_surface(labels, 6)
    inside = (np.abs(wall.points[wall.faces].mean(axis=1)) < [21.0, 21.0, 25.0]).all(axis=1)
    found = distance(tube(9.0), wall.points[wall.faces[inside]].mean(axis=1))
    assert abs(found.mean()) < 0.05
    assert found.std() < 0.12
    # A cap would have faces along the box's own faces, far inside the tube.
    assert found.min() > -0.6
    assert wall.points[:, 2].max() > 30.0


def test_a_wall_that_is_absent_has_no_faces() -> None:
    assert len(wall_surface(boxed_tube((1.0, 1.0, 2.0)), 5).faces) == 0


def test_extend_labels_fills_outside_with_the_nearest_label() -> None:
    array = np.zeros((7, 5, 5), dtype=np.uint8)
    array[2:5, 1:4, 1:4] = 3
    array[4, 1:4, 1:4] = 6
    filled = extend_labels(Volume(array, np.diag([1.0, 1.0, 2.0, 1.0]))).array
    assert (filled[:4] == 3).all()
    assert (filled[5:] == 6).all()
    assert (extend_labels(Volume(filled, np.eye(4))).array == filled).all()


def test_crop_keeps_voxels_where_they_are() -> None:
    labels = paint(grid((1.0, 1.0, 2.0), HALF, np.zeros(3)), ball(5.0, (10.0, -6.0, 8.0)), 1)
    small = crop(labels, labels.array == 1, 3.0)
    assert small.array.size < labels.array.size / 10
    where = small.to_lps(np.argwhere(small.array == 1).astype(float))
    assert where == pytest.approx(labels.to_lps(np.argwhere(labels.array == 1).astype(float)))


def test_specks_go_and_parts_stay() -> None:
    mask = np.zeros((30, 10, 10), dtype=bool)
    mask[1:10, 1:9, 1:9] = True
    mask[15:24, 1:9, 1:9] = True
    mask[28, 5, 5] = True
    kept = without_specks(mask)
    assert kept[1:24].sum() == mask[1:24].sum()
    assert not kept[28].any()
