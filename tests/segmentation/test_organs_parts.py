"""The parts organs are found with: optimal surfaces, edges, prompts, left and right, tissue."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.segmentation.methods.optimal_surface import crossing, optimal_surface, region_cost
from palpate.segmentation.methods.star_surface import ellipsoid_radii, sphere, star
from palpate.segmentation.methods.surface_mesh import shell_of_mask
from palpate.segmentation.prompts import Prompts, check_inside, parse_prompts
from palpate.segmentation.prostate.halves import Plane, halves, midline_normal, split_plane
from palpate.segmentation.tissue import cropped, label_array, region_of_interest
from palpate.segmentation.working_grid import upright


def test_optimal_surface_is_the_best_of_all_surfaces() -> None:
    rng = np.random.default_rng(7)
    edges = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2]])
    for stiffness, max_step in ((0.0, 1), (0.4, 2), (1.5, 4)):
        cost = rng.normal(size=(4, 5))
        best = min(
            (
                cost[range(4), s].sum() + stiffness * sum(abs(s[a] - s[b]) for a, b in edges)
                for s in product(range(5), repeat=4)
                if all(abs(s[a] - s[b]) <= max_step for a, b in edges)
            ),
        )
        found = optimal_surface(cost, edges, max_step, stiffness)
        total = cost[range(4), found].sum() + stiffness * np.abs(found[edges[:, 0]] - found[edges[:, 1]]).sum()
        assert total == pytest.approx(best, abs=0.05)  # costs are rounded to hundredths


def test_region_cost_is_least_where_the_sign_turns() -> None:
    inside = np.array([[0.5, 1.0, 0.2, -0.3, -1.0, 0.1]])
    assert region_cost(inside).argmin() == 2


def test_crossing_is_interpolated_and_near() -> None:
    profile = np.array([[10.0, 4.0, 0.0, 10.0, 2.0], [1.0, 1.0, 1.0, 1.0, 1.0]])
    assert crossing(profile, np.array([1, 1]), 3.0, 3)[0] == pytest.approx(1.25)
    assert crossing(profile, np.array([4, 1]), 3.0, 3)[0] == pytest.approx(3.875)
    assert np.isnan(crossing(profile, np.array([1, 1]), 3.0, 3)[1])


def test_star_of_an_ellipsoid_fills_its_voxels() -> None:
    grid = upright(np.array([-30.0, -20.0, -25.0]), np.array([34.0, 28.0, 30.0]), 1.25)
    semi, centre = np.array([22.0, 14.0, 18.0]), np.array([3.0, 2.0, 1.0])
    mask = star(centre, ellipsoid_radii(semi)).voxels(grid)
    x = (grid.to_lps(np.indices(mask.shape).reshape(3, -1).T.astype(float)) - centre) / semi
    true = ((x**2).sum(axis=1) < 1.0).reshape(mask.shape)
    assert (mask ^ true).sum() / true.sum() < 0.03
    assert mask.sum() / true.sum() == pytest.approx(1.0, abs=0.02)


def test_shell_normals_point_outward() -> None:
    grid = upright(np.full(3, -15.0), np.full(3, 15.0), 1.25)
    ball = star(np.array([1.0, -2.0, 0.5]), np.full(642, 9.0)).voxels(grid)
    shell = shell_of_mask(ball, grid, 1.0)
    away = shell.points - np.array([1.0, -2.0, 0.5])
    assert (np.einsum("ij,ij->i", away, shell.normals) > 0).all()
    assert np.linalg.norm(away, axis=1).mean() == pytest.approx(9.0, abs=0.3)
    assert len(sphere().edges) == 3 * (642 - 2)


def test_prompts_of_the_command_line() -> None:
    prompts = parse_prompts(
        ["prostate=1,-2.5,3"], ["rectum=0,0,0;9,0,0;0,8,0;0,-8,0;1,1,30;1,1,-30"], ["bladder=5,6,7;-1,0,1"]
    )
    assert prompts.mode("prostate") == "click"
    assert prompts.mode("rectum") == "extremes"
    assert prompts.mode("bladder") == "box"
    assert np.array_equal(prompts.boxes["bladder"], [[-1, 0, 1], [5, 6, 7]])
    assert np.array_equal(prompts.point("bladder"), [2, 3, 4])
    assert prompts.box("prostate") is None


@pytest.mark.parametrize(
    ("seeds", "extremes", "message"),
    [
        (["liver=1,2,3"], [], "'liver' is not one of"),
        (["prostate=1,2"], [], "give one point of 3 numbers"),
        (["prostate=1,two,3"], [], "not numbers"),
        (["prostate=1,nan,3"], [], "give one point of 3 numbers"),
        ([], ["prostate=1,2,3;4,5,6"], "give six points of 3 numbers"),
        ([], ["prostate=1,2,3;4,5,3;7,8,3;1,9,3;2,3,3;5,5,4"], "less than 2 mm"),
    ],
)
def test_bad_prompts_are_named(seeds: list[str], extremes: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_prompts(seeds, extremes)


def test_prompts_move_with_the_scan_and_carry_over() -> None:
    quarter = np.eye(4)
    quarter[:2, :2] = [[0, -1], [1, 0]]
    quarter[:3, 3] = [10, 0, 5]
    moved = Prompts({"prostate": np.array([1.0, 2.0, 3.0])}, {}, {"bladder": np.array([[0, 0, 0], [1.0, 2, 3]])}).moved(
        quarter
    )
    assert moved.seeds["prostate"] == pytest.approx([8, 1, 8])
    assert moved.boxes["bladder"] == pytest.approx(np.array([[8, 0, 5], [10, 1, 8]]))
    carried = moved.or_near({"prostate": np.zeros(3), "rectum": np.ones(3)}, 8.0)
    assert carried.mode("prostate") == "click"
    assert carried.mode("rectum") == "carried"
    assert carried.spread_mm == {"rectum": 8.0}


def _bar() -> Volume:
    """A bar along x, thicker on the patient's left, on a grid whose i axis runs to the right."""
    array = np.zeros((20, 9, 9), dtype=bool)
    array[3:18, 3:6, 3:6] = True
    array[3:6, 2:7, 2:7] = True
    affine = np.diag([-2.0, 1.0, 1.0, 1.0])
    affine[:3, 3] = [50.0, -7.0, 3.0]
    return Volume(array, affine)


def test_left_half_has_the_larger_x() -> None:
    bar = _bar()
    normal, source = midline_normal(None)
    plane = split_plane(bar, normal, source)
    sides = halves(bar, plane)
    x = bar.to_lps(np.indices(sides.shape).reshape(3, -1).T.astype(float))[:, 0].reshape(sides.shape)
    assert x[sides == 1].min() > plane.point[0] >= x[sides == 2].max()
    assert (sides > 0).sum() == bar.array.sum()
    assert plane.source == "centroid, patient axis"
    assert plane.point[0] == pytest.approx(x[bar.array].mean())


def test_urethra_moves_the_plane_and_must_lie_inside() -> None:
    bar, normal = _bar(), np.array([1.0, 0.0, 0.0])
    plane = split_plane(bar, normal, "patient axis", np.array([39.5, 0.0, 0.0]))
    assert (halves(bar, plane) == 1).sum() == 3 * 25
    with pytest.raises(InputError, match="on one side"):
        halves(bar, Plane(np.array([90.0, 0.0, 0.0]), normal, "test"))
    with pytest.raises(InputError, match="no prostate"):
        split_plane(bar.with_array(np.zeros_like(bar.array)), normal, "test")


def test_labels_by_rank_and_without_islands() -> None:
    body = np.ones((12, 10, 10), dtype=bool)
    prostate = np.zeros(body.shape, dtype=np.uint8)
    prostate[2:4, 4:6, 4:6], prostate[4:6, 4:6, 4:6] = 2, 1
    bone, bladder = np.zeros_like(body), np.zeros_like(body)
    bone[8] = True
    bladder[1:5, 4:6, 6:9] = True
    bone[4, 5, 7] = True
    labels = label_array(prostate, {"bone": bone, "bladder": bladder}, body)
    assert labels[4, 5, 7] == 5
    assert labels[3, 5, 5] == 2 and labels[4, 5, 5] == 1
    assert (labels[:8] == 3).any() and not (labels[9:] == 3).any()
    assert (labels[9:] == 0).all()


def test_region_of_interest_and_cropping() -> None:
    bar = _bar()
    box = region_of_interest(bar, np.array([3.0, 1.0, 1.0]))
    assert box[0] == pytest.approx([50 - 2 * 17 - 1 - 3, -5 - 2, 5 - 2])
    assert box[1] == pytest.approx([50 - 2 * 3 + 1 + 3, -1 + 2, 9 + 2])
    near = cropped(bar, box)
    assert near.array.sum() == bar.array.sum()
    inside = near.to_lps(np.argwhere(near.array).astype(float))
    assert np.array_equal(inside.min(axis=0), bar.to_lps(np.argwhere(bar.array).astype(float)).min(axis=0))
    low, high = near.to_lps(np.array([[0.0, 0, 0], np.array(near.array.shape) - 1.0]))
    assert (np.minimum(low, high) >= box[0] - 1e-6).all() and (np.maximum(low, high) <= box[1] + 1e-6).all()


def test_a_point_outside_the_scan_is_refused_before_any_work() -> None:
    scan = Volume(np.zeros((20, 30, 40), dtype=np.int16), np.diag([2.0, 2.0, 2.0, 1.0]))
    check_inside(scan, Prompts({"prostate": np.array([10.0, 10.0, 70.0])}), "rest")
    with pytest.raises(InputError, match=r"prostate lies outside the rest scan \(x -1 to 39, y -1 to 59, z -1 to 79\)"):
        check_inside(scan, Prompts({"prostate": np.array([500.0, 10.0, 10.0])}), "rest")
    carried = Prompts({"prostate": np.array([500.0, 10.0, 10.0])}, spread_mm={"prostate": 8.0})
    check_inside(scan, carried, "deformed")
