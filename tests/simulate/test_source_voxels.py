"""What is simulated from labels does not know the voxels that its contours are written on."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.core.arrays import FloatArray
from palpate.imaging.labels import PROSTATE_LEFT, PROSTATE_RIGHT, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces
from palpate.meshing.partition import make_partition
from palpate.simulate.source import VolumeSource, labels_on

SHAPE, SPACING = np.array([40, 40, 38]), np.array([1.8, 1.8, 2.0])
SEMI_AXES_MM = np.array([24.0, 19.0, 21.0])


@pytest.fixture(scope="module")
def drawn() -> VolumeSource:
    affine = np.diag([*SPACING, 1.0])
    affine[:3, 3] = -(SHAPE - 1) / 2 * SPACING + [0.4, -0.3, 0.2]
    places = np.indices(SHAPE).reshape(3, -1).T * SPACING + affine[:3, 3]
    halves = np.where(places[:, 0] < 0.0, PROSTATE_RIGHT, PROSTATE_LEFT)
    inside = ((places / SEMI_AXES_MM) ** 2).sum(axis=1) < 1.0
    labels = np.where(inside, halves, SURROUNDING_TISSUE).reshape(SHAPE).astype(np.uint8)
    return VolumeSource("made-up", Volume(labels, affine), None)


def error_mm(source: VolumeSource, shift: FloatArray) -> float:
    """Root mean square distance of the body's surface from that of its label on a grid moved by a share of a voxel."""
    grid = source.label_grid
    affine = grid.affine.copy()
    affine[:3, 3] = grid.to_lps(shift[None, :])[0]
    surface = organ_surfaces(labels_on(source.labels, Volume(grid.array, affine)))
    return float(np.sqrt(np.mean(make_partition(source.model_labels).bodies[-1].at(surface.points) ** 2)))


def test_the_grid_that_contours_are_written_on_errs_like_any_other(drawn: VolumeSource) -> None:
    shifts = np.random.default_rng(3).uniform(-0.5, 0.5, (4, 3))
    fair = drawn.on_voxels_of_its_own(np.random.default_rng(7))
    own, others = error_mm(fair, np.zeros(3)), np.mean([error_mm(fair, s) for s in shifts])
    assert own == pytest.approx(others, rel=0.35)
    # Contours on the grid that the body comes from would show a third of the error that a second scan has.
    assert error_mm(drawn, np.zeros(3)) < 0.5 * others


def test_contours_are_written_where_they_were_drawn(drawn: VolumeSource) -> None:
    fair = drawn.on_voxels_of_its_own(np.random.default_rng(7))
    np.testing.assert_array_equal(fair.label_grid.affine, drawn.model_labels.affine)
    first, again = (labels_on(s.labels, s.label_grid).array != SURROUNDING_TISSUE for s in (drawn, fair))
    assert 2.0 * (first & again).sum() / (first.sum() + again.sum()) > 0.95


def test_what_is_meshed_is_the_same_for_every_grid(drawn: VolumeSource) -> None:
    one, other = (drawn.on_voxels_of_its_own(np.random.default_rng(seed)) for seed in (7, 8))
    assert one.body is other.body is drawn.model_labels
    assert (one.model_labels.affine != other.model_labels.affine).any()
