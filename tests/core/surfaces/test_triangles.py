"""Normals, areas and volumes of triangles against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from triangle_shapes import icosphere

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import cell_volumes
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.triangles import area_vectors, areas, enclosed_volume, normals, point_normals

RIGHT_ANGLED = np.array([[0.0, 0.0, 2.0], [3.0, 0.0, 2.0], [0.0, 4.0, 2.0]])


def octahedron() -> tuple[FloatArray, IntArray]:
    """Corners at distance 1 on the axes, faces outwards."""
    points = np.vstack([np.eye(3), -np.eye(3)])
    faces = [(x, y, z) for x in (0, 3) for y in (1, 4) for z in (2, 5)]
    outward = [f if np.linalg.det(points[list(f)]) > 0.0 else (f[0], f[2], f[1]) for f in faces]
    return points, np.array(outward, dtype=np.int64)


def test_a_three_four_five_triangle() -> None:
    assert area_vectors(RIGHT_ANGLED).tolist() == [0.0, 0.0, 6.0]
    assert areas(RIGHT_ANGLED) == 6.0
    assert normals(RIGHT_ANGLED[None]).tolist() == [[0.0, 0.0, 1.0]]
    assert normals(RIGHT_ANGLED[[0, 2, 1]]).tolist() == [0.0, 0.0, -1.0]


def test_area_follows_heron_s_formula_in_any_position() -> None:
    corners = np.random.default_rng(1).normal(scale=20.0, size=(200, 4, 3, 3))
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=2), axis=3)
    half = 0.5 * sides.sum(axis=2)
    assert areas(corners) == pytest.approx(np.sqrt(half * np.prod(half[..., None] - sides, axis=2)), rel=1e-8)


def test_a_needle_has_no_area_and_no_normal() -> None:
    needle = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]])
    assert areas(needle) == 0.0
    assert normals(needle).tolist() == [0.0, 0.0, 0.0]


def test_an_octahedron_s_normals_volume_and_area() -> None:
    points, faces = octahedron()
    assert point_normals(points, faces) == pytest.approx(points, abs=1e-15)
    assert normals(points[faces]) == pytest.approx(points[faces].sum(axis=1) / np.sqrt(3.0), rel=1e-14)
    assert enclosed_volume(points, faces) == pytest.approx(4.0 / 3.0, rel=1e-14)
    assert enclosed_volume(points + [100.0, -50.0, 7.0], faces) == pytest.approx(4.0 / 3.0, rel=1e-9)
    assert enclosed_volume(points, faces[:, ::-1]) == pytest.approx(-4.0 / 3.0, rel=1e-14)
    assert areas(points[faces]).sum() == pytest.approx(4.0 * np.sqrt(3.0), rel=1e-14)


def test_a_mid_edge_node_gets_the_mean_of_its_faces_and_a_loose_point_nothing() -> None:
    points = np.vstack([RIGHT_ANGLED, 0.5 * (RIGHT_ANGLED + np.roll(RIGHT_ANGLED, -1, axis=0)), [[9.0, 9.0, 9.0]]])
    found = point_normals(points, np.arange(6)[None])
    assert found[:6].tolist() == [[0.0, 0.0, 1.0]] * 6
    assert found[6].tolist() == [0.0, 0.0, 0.0]


def test_a_tetrahedron_of_four_corners_of_a_cube_has_a_sixth_of_it() -> None:
    points = np.vstack([np.zeros(3), np.diag([2.0, 3.0, 4.0])])
    assert cell_volumes(points, np.array([[0, 1, 2, 3], [0, 2, 1, 3]])).tolist() == [4.0, -4.0]


def test_a_surface_s_faces_parts_and_rim() -> None:
    points, faces = icosphere(3)
    left = (points[faces].mean(axis=1)[:, 0] < 0.0).astype(np.int64) + 1
    ball = Surface(10.0 * points, faces, left)
    assert ball.areas.sum() == pytest.approx(4.0 * np.pi * 100.0, rel=0.02)
    assert ball.enclosed_volume == pytest.approx(4.0 / 3.0 * np.pi * 1000.0, rel=0.02)
    assert np.einsum("ij,ij->i", ball.point_normals, points).min() > 0.999
    assert sum(len(ball.part(k).faces) for k in (1, 2)) == len(faces)
    both = np.intersect1d(faces[left == 1], faces[left == 2])
    assert ball.rim.tolist() == both.tolist()
    assert ball.with_points(20.0 * points).areas == pytest.approx(4.0 * ball.areas, rel=1e-12)


def test_an_absent_structure_is_a_surface_without_faces() -> None:
    nothing = Surface.empty()
    assert len(nothing.faces) == len(nothing.rim) == len(nothing.areas) == 0
