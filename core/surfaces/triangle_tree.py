"""A balanced tree of boxes over a triangle surface, and the surface's angle-weighted normals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.surfaces.triangles import normals as triangle_normals

# Triangles in one leaf of the tree, chosen by timing.
_LEAF = 4


@dataclass(frozen=True, eq=False)
class TriangleTree:
    """A surface prepared for closest-point queries. All arrays are plain, so compiled loops can read them.

    corners : (f, 3, 3) mm. faces : (f, 3) indices into the points after coincident ones were joined.
    boxes : (2 L - 1, 6) lower and upper corner; node i has children 2 i + 1 and 2 i + 2, the last L nodes are leaves.
    order : (L, leaf) triangles of each leaf (some twice, to fill it). face_normals : (f, 3) unit, zero for a needle.
    normals : (f, 7, 3) pseudo-normals, not unit, of a face, its corners 0, 1, 2 and its edges 01, 12, 20
    (Baerentzen and Aanaes 2005). rim : (f, 7) whether that part of the face bounds an open surface.
    """

    corners: FloatArray
    faces: IntArray
    boxes: FloatArray
    order: IntArray
    normals: FloatArray
    rim: BoolArray

    @classmethod
    def of(cls, points: FloatArray, faces: IntArray) -> TriangleTree:
        """Build from points (n, 3) mm and faces (f, 3); raises InputError for an empty or invalid surface."""
        points, faces = _checked(points, faces)
        corners = np.ascontiguousarray(points[faces])
        order = _median_split(corners.mean(axis=1))
        normals, rim = _pseudo_normals(points, faces)
        return cls(corners, faces, _boxes(corners, order), order, normals, rim)


def _checked(points: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Coincident points joined, since a crack of width zero would look like the rim of an open surface."""
    points, faces = np.asarray(points, dtype=np.float64), np.asarray(faces, dtype=np.int64)
    if points.ndim != 2 or points.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
        raise InputError(f"a surface needs points (n, 3) and faces (f, 3), f > 0; it has {points.shape}, {faces.shape}")
    if faces.min() < 0 or faces.max() >= len(points):
        raise InputError(f"a surface face names point {faces.max()} of {len(points)}")
    if not np.isfinite(points[faces]).all():
        raise InputError("a surface point is not finite")
    points, joined = np.unique(points, axis=0, return_inverse=True)
    faces = joined.reshape(-1)[faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    if len(faces) == 0:
        raise InputError("every face of a surface is degenerate")
    return points, faces


def _median_split(centres: FloatArray) -> IntArray:
    """Triangles ordered into 2^k groups of equal size by halving along the longest side of each group, level by level."""
    n_leaves = 1
    while n_leaves * _LEAF < len(centres):
        n_leaves *= 2
    groups = np.arange(n_leaves * _LEAF)[None, :] % len(centres)
    while len(groups) < n_leaves:
        inside = centres[groups]
        axis = np.argmax(inside.max(axis=1) - inside.min(axis=1), axis=1)
        keys = np.take_along_axis(inside, axis[:, None, None], axis=2)[:, :, 0]
        groups = np.take_along_axis(groups, np.argsort(keys, axis=1, kind="stable"), axis=1)
        groups = groups.reshape(2 * len(groups), -1)
    return np.ascontiguousarray(groups)


def _boxes(corners: FloatArray, order: IntArray) -> FloatArray:
    """Boxes of leaves, then of each pair, up to the root, which comes first."""
    inside = corners[order].reshape(len(order), -1, 3)
    levels = [np.hstack([inside.min(axis=1), inside.max(axis=1)])]
    while len(levels[-1]) > 1:
        pair = levels[-1].reshape(-1, 2, 6)
        levels.append(np.hstack([pair[:, :, :3].min(axis=1), pair[:, :, 3:].max(axis=1)]))
    return np.ascontiguousarray(np.vstack(levels[::-1]))


def _pseudo_normals(points: FloatArray, faces: IntArray) -> tuple[FloatArray, BoolArray]:
    """Normals (f, 7, 3) and rim flags (f, 7) of every face, corner and edge, in the order of `TriangleTree.normals`."""
    X = points[faces]
    face = triangle_normals(X)
    at_point = np.zeros_like(points)
    for k in range(3):
        to_next, to_last = X[:, (k + 1) % 3] - X[:, k], X[:, (k + 2) % 3] - X[:, k]
        angle = np.arctan2(np.linalg.norm(np.cross(to_next, to_last), axis=1), (to_next * to_last).sum(axis=1))
        np.add.at(at_point, faces[:, k], angle[:, None] * face)
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, edge, uses = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    edge = edge.ravel()
    at_edge = np.zeros((len(uses), 3))
    np.add.at(at_edge, edge, np.repeat(face, 3, axis=0))
    open_edge = uses[edge] == 1
    open_point = np.zeros(len(points), dtype=bool)
    open_point[ends[open_edge]] = True
    normals = np.concatenate([face[:, None], at_point[faces], at_edge[edge].reshape(-1, 3, 3)], axis=1)
    closed = np.zeros((len(faces), 1), dtype=bool)
    rim = np.concatenate([closed, open_point[faces], open_edge.reshape(-1, 3)], axis=1)
    return np.ascontiguousarray(normals), np.ascontiguousarray(rim)
