"""Eqs 10 to 13 on surfaces whose distances are known."""

import numpy as np
import pytest
from triangle_shapes import box, icosphere

from palpate.core.errors import InputError
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.surface_distance import SurfaceMisfit, region_distances, surface_misfit
from palpate.core.surfaces.triangle_tree import TriangleTree


def of_one_region(points: np.ndarray, target: TriangleTree) -> SurfaceMisfit:
    return surface_misfit(points, np.ones(len(points), dtype=int), {1: target})


def test_hausdorff_is_one_sided_and_to_the_surface_not_its_points():
    cube = TriangleTree.of(*box((0, 0, 0), (10, 20, 30)))
    points = np.array([[5.0, 10.0, -0.5], [12.0, 10.0, 15.0], [3.0, 7.0, 30.0]])
    assert of_one_region(points, cube).hausdorff_mm == pytest.approx(2.0, abs=1e-12)
    assert of_one_region(points, cube).objective_mm2 == pytest.approx(0.25 + 4.0, abs=1e-12)
    back = TriangleTree.of(points, np.array([[0, 1, 2]]))
    assert of_one_region(box((0, 0, 0), (10, 20, 30))[0], back).hausdorff_mm > 10.0


def test_a_surface_on_its_target_has_no_misfit():
    points, faces = icosphere(2, (3, 4, 5))
    misfit = surface_misfit(points, np.ones(len(points), dtype=int), {1: TriangleTree.of(points, faces)})
    assert misfit.hausdorff_mm < 1e-12
    assert misfit.points == len(points)


def two_halves():
    """An asymmetric box cut at x = 4 into regions 1 (left) and 2: triangles, their regions, per-region targets."""
    left, right = box((0, 0, 0), (4, 5, 6)), box((4, 0, 0), (11, 5, 6))
    points, index = np.unique(np.vstack([left[0], right[0]]), axis=0, return_inverse=True)
    faces = index.ravel()[np.vstack([left[1], right[1] + 8])]
    region = np.repeat([1, 2], 12)
    outer = ~(points[faces][:, :, 0] == 4.0).all(axis=1)
    faces, region = faces[outer], region[outer]
    return points, faces, region, {m: TriangleTree.of(points, faces[region == m]) for m in (1, 2)}


def test_shared_points_are_those_on_the_dividing_plane():
    points, faces, region, _ = two_halves()
    np.testing.assert_array_equal(Surface(points, faces, region).rim, np.flatnonzero(points[:, 0] == 4.0))


def test_each_region_is_measured_against_its_own_target():
    """A point of region 2 that lies on region 1's target is not at distance zero, as it would be without Eq 13's split."""
    *_, targets = two_halves()
    points = np.array([[1.0, 2.0, 6.0], [1.0, 2.0, 6.0], [7.0, 2.0, 6.5]])
    d = region_distances(points, np.array([1, 2, 2]), targets)
    np.testing.assert_allclose(d, [0.0, 3.0, 0.5], atol=1e-12)
    assert surface_misfit(points, np.array([1, 2, 2]), targets).objective_mm2 == pytest.approx(9.25)


def test_shared_points_do_not_count():
    points, faces, region, targets = two_halves()
    owner = np.where(points[:, 0] < 4.0, 1, 2)
    shared = np.isin(np.arange(len(points)), Surface(points, faces, region).rim)
    moved = points + np.where(shared[:, None], 100.0, 0.0)
    assert surface_misfit(moved[~shared], owner[~shared], targets).objective_mm2 == 0.0
    assert surface_misfit(moved, owner, targets).objective_mm2 > 1000.0


def test_figures_follow_their_definitions():
    cube = TriangleTree.of(*box((0, 0, 0), (100, 100, 1)))
    heights = np.arange(1.0, 102.0)
    points = np.stack([np.full(101, 50.0), np.full(101, 50.0), 1.0 + heights], axis=1)
    misfit = surface_misfit(points, np.full(101, 7), {7: cube})
    assert misfit.rms_mm == pytest.approx(np.sqrt(np.mean(heights**2)))
    assert misfit.p95_mm == pytest.approx(96.0)
    assert misfit.hausdorff_mm == pytest.approx(101.0)
    assert misfit.objective_mm2 == pytest.approx(np.sum(heights**2))


def test_missing_targets_and_points_are_named():
    points, *_, targets = two_halves()
    with pytest.raises(InputError, match="region 3 has points"):
        region_distances(points, np.full(len(points), 3), targets)
    with pytest.raises(InputError, match="no surface point belongs to one region"):
        region_distances(points[:0], np.ones(0), targets)
