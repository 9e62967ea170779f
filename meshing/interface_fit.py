"""Interface vertices laid so that flat faces follow the smooth surfaces without bias, and cells kept in shape.

The mesher leaves vertices within its envelope of the triangles it was given, and flat faces between vertices on a
convex surface cut it short: an organ of radius 18 mm with edges of 5 mm loses 2 % of its volume. Here vertices move
along the normal so that the squared distance between faces and surface, summed over the faces, is least.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.linalg import cg

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import FACES_OF_CELL, cell_volumes
from palpate.core.statistics import rms
from palpate.core.surfaces.triangles import areas, point_normals
from palpate.imaging.labels import ORGAN_LABELS, OUTSIDE
from palpate.meshing.cell_shape import shape
from palpate.meshing.cells import KEPT, face_neighbours
from palpate.meshing.partition import HOLE_NAMES, ORGAN, Partition
from palpate.meshing.quality import InterfaceFigures
from palpate.meshing.smooth_distance import SmoothField

# A vertex may move by this share of its shortest surface edge in one fit.
LARGEST_MOVE = 0.35
# No move may make a cell worse than this, unless it was worse before.
FLOOR_DEG = 12.0
# Edge midpoints, in corner weights: exact for the square of a linear function.
MIDPOINTS = np.array([[0.5, 0.5, 0.0], [0.0, 0.5, 0.5], [0.5, 0.0, 0.5]])


@dataclass(frozen=True, eq=False)
class Interface:
    """Faces (f, 3) of a mesh, oriented out of what the field is positive in, and the field whose zero they stand for."""

    faces: IntArray
    field: SmoothField

    def distance(self, points: FloatArray, weights: FloatArray = MIDPOINTS) -> FloatArray:
        """Signed distance (f, w) mm of points of the faces from the surface, positive outside."""
        at = np.einsum("wc,fck->fwk", weights, points[self.faces]).reshape(-1, 3)
        slope = np.clip(np.linalg.norm(self.field.gradient(at), axis=1), 0.5, 1.5)
        return (-self.field.at(at) / slope).reshape(-1, len(weights))


def interfaces_of(cells: IntArray, labels: IntArray, partition: Partition) -> dict[str, Interface]:
    """The interfaces of labelled cells by name: "organ", "divide", and the holes that are there."""
    across = face_neighbours(cells)
    beyond = np.where(across >= 0, labels[across], OUTSIDE)
    faces = cells[:, FACES_OF_CELL]
    organ, other_organ = np.isin(labels, ORGAN_LABELS)[:, None], np.isin(beyond, ORGAN_LABELS)
    found = {"organ": Interface(faces[organ & ~other_organ], partition.against_others(ORGAN))}
    divide = (labels == ORGAN_LABELS[0])[:, None] & (beyond == ORGAN_LABELS[1])
    if divide.any():
        found["divide"] = Interface(faces[divide], partition.divide(*ORGAN_LABELS))
    for label, name in HOLE_NAMES.items():
        wall = (labels == label)[:, None] & np.isin(beyond, KEPT)
        if wall.any():
            found[name] = Interface(faces[wall], partition.against_others(label))
    return found


def interface_report(points: FloatArray, interface: Interface) -> InterfaceFigures:
    """Distance in mm of the faces, and of their vertices, from the smooth surface (positive outside)."""
    inner = np.vstack([np.full((1, 3), 1.0 / 3.0), 0.2 + 0.4 * np.eye(3)])
    faces = interface.distance(points, inner)
    nodes = interface.distance(points, np.eye(3))
    return {
        "faces": len(interface.faces),
        "mean_mm": float(faces.mean()),
        "rms_mm": rms(faces),
        "p95_mm": float(np.percentile(np.abs(faces), 95)),
        "max_mm": float(np.abs(faces).max()),
        "vertex_p95_mm": float(np.percentile(np.abs(nodes), 95)),
    }


def fit_interfaces(points: FloatArray, cells: IntArray, interfaces: list[Interface], rounds: int = 2) -> FloatArray:
    """Points (n, 3) mm moved so that each interface is the least-squares flat-faced surface of its field.

    A vertex on several interfaces moves so that it meets the wish of each. Moves that would flatten a cell are halved,
    and given up after five halvings.
    """
    for _ in range(rounds):
        wishes = [_wish(points, interface) for interface in interfaces]
        points = guarded_move(points, cells, _combine(len(points), wishes))
    return points


def guarded_move(points: FloatArray, cells: IntArray, move: FloatArray) -> FloatArray:
    """Points moved by ``move`` (n, 3) where that leaves every cell in shape, by less or not at all elsewhere."""
    before = shape(points, cells)
    bound = np.minimum(before - 0.5, FLOOR_DEG)
    share = np.ones(len(points))
    for halving in range(7):
        moved = points + share[:, None] * move
        bad = (shape(moved, cells) < bound) | (cell_volumes(moved, cells) <= 0.0)
        if not bad.any():
            return moved
        share[np.unique(cells[bad])] *= 0.5 if halving < 5 else 0.0
    return points


def _wish(points: FloatArray, interface: Interface) -> tuple[IntArray, FloatArray, FloatArray]:
    """For one interface: its vertices (v,), their unit normals (v, 3) and wished moves along them (v,) mm."""
    nodes, local = np.unique(interface.faces, return_inverse=True)
    local = local.reshape(-1, 3)
    area = areas(points[interface.faces])
    normal = point_normals(points[nodes], local)
    rows = np.repeat(np.arange(3 * len(local)), 3)
    entries = np.tile(MIDPOINTS.ravel(), len(local)) * np.sqrt(np.repeat(area / 3.0, 9))
    matrix = coo_array((entries, (rows, np.repeat(local, 3, axis=0).ravel())), shape=(3 * len(local), len(nodes)))
    aim = -interface.distance(points).ravel() * np.sqrt(np.repeat(area / 3.0, 3))
    move, _ = cg(matrix.T @ matrix, matrix.T @ aim, rtol=1e-6)
    shortest = np.full(len(nodes), np.inf)
    for one, two in ((0, 1), (1, 2), (2, 0)):
        edge = np.linalg.norm(points[interface.faces[:, one]] - points[interface.faces[:, two]], axis=1)
        np.minimum.at(shortest, local[:, one], edge)
        np.minimum.at(shortest, local[:, two], edge)
    return nodes, normal, np.clip(move, -LARGEST_MOVE * shortest, LARGEST_MOVE * shortest)


def _combine(n_points: int, wishes: list[tuple[IntArray, FloatArray, FloatArray]]) -> FloatArray:
    """The smallest moves (n, 3) whose normal parts are what each interface wishes."""
    normals = np.zeros((n_points, 3, 3))
    right = np.zeros((n_points, 3))
    for nodes, normal, move in wishes:
        normals[nodes] += normal[:, :, None] * normal[:, None, :]
        right[nodes] += normal * move[:, None]
    # Interfaces that meet at a small angle would send their vertex far away: directions weaker than 0.1 are left alone.
    return np.asarray(np.einsum("nij,nj->ni", np.linalg.pinv(normals, rcond=0.1, hermitian=True), right))
