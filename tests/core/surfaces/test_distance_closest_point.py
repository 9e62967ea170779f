"""Closest points against brute force by another formula and against closed forms."""

import time

import numpy as np
import pytest
from triangle_shapes import box, icosphere, tube

from palpate.core.errors import InputError
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree


def brute_force(x, points, faces):
    """Smallest of: distance to the plane where the foot is inside, and distance to the three edges as segments."""
    best = np.full(len(x), np.inf)
    for face in faces:
        t = points[face]
        n = np.cross(t[1] - t[0], t[2] - t[0])
        n /= np.linalg.norm(n)
        height = (x - t[0]) @ n
        foot = x - height[:, None] * n
        inside = np.ones(len(x), dtype=bool)
        for k in range(3):
            e = t[(k + 1) % 3] - t[k]
            inside &= np.cross(e, foot - t[k]) @ n >= 0
            s = np.clip((x - t[k]) @ e / (e @ e), 0, 1)
            best = np.minimum(best, np.linalg.norm(x - t[k] - s[:, None] * e, axis=1))
        best = np.where(inside, np.minimum(best, np.abs(height)), best)
    return best


def test_equals_brute_force_on_random_triangles():
    rng = np.random.default_rng(3)
    points, faces = rng.normal(size=(90, 3)) * [5, 2, 9], np.arange(90).reshape(-1, 3)
    x = rng.normal(size=(800, 3)) * [8, 4, 12]
    found = closest_points(TriangleTree.of(points, faces), x)
    np.testing.assert_allclose(found.distance, brute_force(x, points, faces), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(x - found.point, axis=1), found.distance, atol=1e-12)


def test_barycentric_coordinates_give_the_point_and_stay_in_the_triangle():
    points, faces = icosphere(2, (3, 5, 8))
    tree = TriangleTree.of(points, faces)
    found = closest_points(tree, np.random.default_rng(0).uniform(-9, 9, (500, 3)))
    rebuilt = np.einsum("qk,qki->qi", found.barycentric, tree.corners[found.triangle])
    np.testing.assert_allclose(rebuilt, found.point, atol=1e-12)
    assert found.barycentric.min() >= -1e-12
    np.testing.assert_allclose(found.barycentric.sum(axis=1), 1.0, atol=1e-12)


def test_signed_distance_of_a_box_is_the_closed_form():
    low, high = np.array([-1.0, 2.0, 3.0]), np.array([4.0, 4.0, 11.0])
    x = np.random.default_rng(1).uniform(low - 6, high + 6, (4000, 3))
    found = closest_points(TriangleTree.of(*box(low, high)), x)
    q = np.abs(x - (low + high) / 2) - (high - low) / 2
    expected = np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)
    np.testing.assert_allclose(found.signed, expected, atol=1e-12)


def test_sign_is_right_where_the_closest_part_is_a_sharp_corner():
    """A face normal, or a plain mean of them, gets points near a thin spike's tip wrong."""
    points = np.array([[0, 0, 10.0], [1, 0, 0], [-0.5, 0.8, 0], [-0.5, -0.8, 0], [0.1, 0, 9.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    x = np.random.default_rng(5).normal(size=(3000, 3)) + [0, 0, 10.5]
    a, b, c, d = points[0], points[1], points[2], points[3]
    inverse = np.linalg.inv(np.stack([b - a, c - a, d - a], axis=1))
    weights = (x - a) @ inverse.T
    inside = (weights >= 0).all(axis=1) & (weights.sum(axis=1) <= 1)
    found = closest_points(TriangleTree.of(points, faces), x)
    np.testing.assert_array_equal(found.signed < 0, inside)


def test_coincident_points_and_degenerate_faces_change_nothing():
    points, faces = icosphere(2, (6, 7, 8))
    x = np.random.default_rng(2).uniform(-10, 10, (500, 3))
    expected = closest_points(TriangleTree.of(points, faces), x).signed
    soup = points[faces].reshape(-1, 3)
    soup_faces = np.vstack([np.arange(len(soup)).reshape(-1, 3), [[0, 0, 1], [4, 5, 5]]])
    np.testing.assert_array_equal(np.abs(closest_points(TriangleTree.of(soup, soup_faces), x).signed), np.abs(expected))
    assert not TriangleTree.of(soup, soup_faces).rim.any()


def test_rim_is_known_for_an_open_surface_only():
    assert not TriangleTree.of(*icosphere(1)).rim.any()
    points, faces = tube(4.0, 10.0, 24, 5)
    tree = TriangleTree.of(points, faces)
    assert tree.rim[:, 4:].sum() == 48


def test_order_of_queries_does_not_matter():
    points, faces = icosphere(3, (9, 12, 7))
    tree, x = TriangleTree.of(points, faces), np.random.default_rng(8).uniform(-15, 15, (2000, 3))
    shuffled = np.random.default_rng(9).permutation(len(x))
    np.testing.assert_array_equal(
        closest_points(tree, x).distance[shuffled], closest_points(tree, x[shuffled]).distance
    )


def test_twenty_thousand_points_on_twenty_thousand_triangles_are_fast():
    """0.2 s on an idle core; processor time and a threefold allowance, since others may use the machine."""
    points, faces = icosphere(5, (20, 25, 18))
    tree = TriangleTree.of(points, faces)
    x = np.random.default_rng(4).uniform(-30, 30, (20_000, 3))
    closest_points(tree, x[:2])
    start = time.process_time()
    closest_points(tree, x)
    assert len(faces) > 20_000
    assert time.process_time() - start < 0.6


@pytest.mark.parametrize(
    ("points", "faces", "message"),
    [
        (np.zeros((3, 3)), np.zeros((0, 3), dtype=int), "a surface needs points"),
        (np.zeros((3, 3)), np.array([[0, 1, 3]]), "names point 3 of 3"),
        (np.array([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), "not finite"),
        (np.ones((3, 3)), np.array([[0, 1, 2]]), "degenerate"),
    ],
)
def test_an_unusable_surface_is_refused(points, faces, message):
    with pytest.raises(InputError, match=message):
        TriangleTree.of(points, faces)
