"""Cleaning of cell labels, and moves of vertices that keep cells in shape, on small meshes of cubes."""

from __future__ import annotations

from itertools import permutations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.meshing.cell_shape import dihedral_angles, shape
from palpate.meshing.cells import clean_labels, face_neighbours, parts_of
from palpate.meshing.improve import improve_cells, tangent_limits
from palpate.meshing.interface_fit import guarded_move


def cubes(n: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Points, cells, and the cube (m, 3) of each cell, of n x n x n cubes of six cells each."""
    number = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    points = np.argwhere(number >= 0).astype(float)
    cells, owner = [], []
    for i, j, k in np.argwhere(np.ones((n, n, n))):
        for way in permutations(range(3)):
            corner, path = np.array([i, j, k]), []
            for axis in (*way, -1):
                path.append(number[tuple(corner)])
                if axis >= 0:
                    corner[axis] += 1
            odd = np.linalg.det(np.eye(3)[list(way)]) < 0
            cells.append([path[0], path[2], path[1], path[3]] if odd else path)
            owner.append([i, j, k])
    return points, np.array(cells), np.array(owner)


def labelled(owner: IntArray, array: IntArray) -> IntArray:
    return array[tuple(owner.T)]


def test_neighbours_share_three_points() -> None:
    _, cells, _ = cubes(3)
    across = face_neighbours(cells)
    for cell, vertex in np.argwhere(across >= 0):
        assert set(np.delete(cells[cell], vertex)) <= set(cells[across[cell, vertex]])
    assert (across < 0).sum() == 6 * 9 * 2


def test_a_floating_speck_of_tissue_goes() -> None:
    points, cells, owner = cubes(5)
    array = np.full((5, 5, 5), 6)
    array[0:2] = 3
    array[0, 1:3, 1:3] = 1
    array[4, 4, 4] = 3
    cleaned = clean_labels(cells, labelled(owner, array), len(points))
    assert (cleaned[labelled(owner, array) == 1] == 1).all()
    assert parts_of(face_neighbours(cells), np.isin(cleaned, (1, 2, 3))).max() == 0
    assert (cleaned[(owner == 4).all(axis=1)] == 6).all()


def test_tissue_that_hangs_by_an_edge_goes() -> None:
    points, cells, owner = cubes(4)
    array = np.full((4, 4, 4), 5)
    array[0:2, 0:2] = 3
    array[0, 0, 0] = 1
    array[2, 2, 0] = 3  # meets the block along one edge only
    cleaned = clean_labels(cells, labelled(owner, array), len(points))
    assert (cleaned[(owner == [2, 2, 0]).all(axis=1)] == 5).all()
    assert (cleaned[(owner[:, :2] < 2).all(axis=1)] != 5).all()


def test_a_loose_part_of_an_organ_region_joins_its_neighbour() -> None:
    points, cells, owner = cubes(4)
    array = np.full((4, 4, 4), 3)
    array[1:3, 0:2, 1:3] = 1
    array[1:3, 2:4, 1:3] = 2
    array[1, 3, 1] = 1  # a bit of the first region, lost in the second
    cleaned = clean_labels(cells, labelled(owner, array), len(points))
    across = face_neighbours(cells)
    assert parts_of(across, cleaned == 1).max() == 0
    assert parts_of(across, cleaned == 2).max() == 0


def test_a_move_that_would_flatten_a_cell_is_cut_short() -> None:
    points, cells, _ = cubes(2)
    move = np.zeros_like(points)
    centre = int(np.flatnonzero((points == 1.0).all(axis=1))[0])
    move[centre] = [0.99, 0.99, 0.99]
    moved = guarded_move(points, cells, move)
    assert np.linalg.norm(moved[centre] - points[centre]) > 0.05
    assert shape(moved, cells).min() > 10.0
    assert np.array_equal(np.delete(moved, centre, axis=0), np.delete(points, centre, axis=0))


def test_improving_raises_the_worst_cell_and_keeps_surfaces() -> None:
    points, cells, owner = cubes(4)
    labels = np.where(owner[:, 0] < 2, 1, 3)
    rng = np.random.default_rng(3)
    inner = ((points > 0) & (points < 4)).all(axis=1)
    points[inner & (points[:, 0] != 2)] += rng.uniform(-0.3, 0.3, (int((inner & (points[:, 0] != 2)).sum()), 3))
    limits = tangent_limits(points, cells, labels)
    better = improve_cells(points, cells, limits, wanted_deg=35.0)
    assert dihedral_angles(better, cells).min() > dihedral_angles(points, cells).min() + 2.0
    # The plane between the regions and the outside stay plane; corners stay where they are.
    assert np.allclose(better[points[:, 0] == 2.0, 0], 2.0)
    for side in (0.0, 4.0):
        assert all(np.allclose(better[points[:, axis] == side, axis], side) for axis in range(3))
