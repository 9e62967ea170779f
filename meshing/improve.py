"""Bad cells made better by moving their vertices one at a time."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import FACES_OF_CELL, cell_volumes
from palpate.core.surfaces.triangles import normals
from palpate.meshing.cell_shape import shape
from palpate.meshing.cells import face_neighbours

# Directions tried: the corners, edges and faces of a cube.
DIRECTIONS = np.array([[i, j, k] for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1) if (i, j, k) != (0, 0, 0)])
DIRECTIONS = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
STEPS = (0.25, 0.12, 0.05)


def improve_cells(
    points: FloatArray,
    cells: IntArray,
    normals: dict[int, FloatArray],
    wanted_deg: float = 18.0,
    slack_mm: float = 0.0,
    rounds: int = 4,
) -> FloatArray:
    """Points (n, 3) mm with cells flatter than ``wanted_deg`` (by ``shape``) rounded where they can be.

    normals : for a vertex on interfaces the unit normals (k, 3) it must not move along by more than ``slack_mm`` a
    round; free vertices are not named. The points given are left as they are.
    """
    points = points.copy()
    star_of = _stars(cells, len(points))
    for _ in range(rounds):
        angles = shape(points, cells)
        bad = np.flatnonzero(angles < wanted_deg)
        moved = False
        for node in np.unique(cells[bad]).tolist():
            moved |= _improve_one(points, cells[star_of[node]], node, normals.get(node), slack_mm)
        if not moved:
            break
    return points


def tangent_limits(points: FloatArray, cells: IntArray, labels: IntArray) -> dict[int, FloatArray]:
    """For each vertex on a face between different labels, the unit directions (k, 3), k = 1 to 3, it must not move along.

    One direction on a smooth surface, two where surfaces meet or fold, three at a corner.
    """
    across = face_neighbours(cells)
    beyond = np.where(across >= 0, labels[across], -1)
    faces = cells[:, FACES_OF_CELL][labels[:, None] != beyond]
    normal = normals(points[faces])
    spread = np.zeros((len(points), 3, 3))
    for corner in range(3):
        np.add.at(spread, faces[:, corner], normal[:, :, None] * normal[:, None, :])
    values, vectors = np.linalg.eigh(spread)
    # Eigenvalues are squares: 0.15 lets a surface bend by some 20 degrees around a vertex before it counts as folded.
    strong = values > 0.15 * np.maximum(values[:, -1:], 1e-12)
    return {int(i): vectors[i][:, strong[i]].T for i in np.unique(faces)}


def _stars(cells: IntArray, n_points: int) -> list[IntArray]:
    order = np.argsort(cells.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(cells.ravel(), minlength=n_points))
    return [part // 4 for part in np.split(order, ends[:-1])]


def _improve_one(points: FloatArray, star: IntArray, node: int, fixed: FloatArray | None, slack_mm: float) -> bool:
    """Move one vertex to the best of a few places around it; False when none is better."""
    around = points[star]
    here = points[node]
    moves = _moves(float(np.linalg.norm(around - here, axis=2).max(axis=1).mean()), fixed, slack_mm)
    if len(moves) == 0:
        return False
    own = star == node
    trials = np.where(own[None, :, :, None], here + moves[:, None, None, :], around[None])
    flat = trials.reshape(-1, 3)
    index = np.arange(len(flat)).reshape(-1, 4)
    angle = shape(flat, index)
    angle[cell_volumes(flat, index) <= 0.0] = -1.0
    worst = angle.reshape(len(moves), -1).min(axis=1)
    present = float(shape(points, star).min())
    best = int(np.argmax(worst))
    if worst[best] <= present + 0.1:
        return False
    points[node] = here + moves[best]
    return True


def _moves(size_mm: float, fixed: FloatArray | None, slack_mm: float) -> FloatArray:
    """Moves (k, 3) mm to try for a vertex whose cells are of this size."""
    steps = size_mm * np.array(STEPS)
    if fixed is None:
        return np.concatenate([step * DIRECTIONS for step in steps])
    # Only in the tangent plane, or along the line in which two interfaces meet, and a little in any direction.
    tangent = DIRECTIONS @ (np.eye(3) - np.linalg.pinv(fixed) @ fixed)
    length = np.linalg.norm(tangent, axis=1)
    tangent = tangent[length > 0.3] / length[length > 0.3, None]
    moves = [step * tangent for step in steps] + [step * DIRECTIONS for step in (0.5 * slack_mm, slack_mm) if step]
    return np.concatenate(moves)
