"""Exact closest points on a triangle surface, with signed distance by angle-weighted pseudo-normals.

Closest point in a triangle: Ericson, Real-Time Collision Detection (2005), 5.1.5. Sign: Baerentzen and Aanaes (2005),
Signed distance computation using the angle weighted pseudonormal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.core.worker.threads import in_threads

# Points that one thread searches in a row. Part of the answer: where two triangles are as near, it is the one met first.
_IN_A_ROW = 8192


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """For q query points: distance (q,) mm; point (q, 3) mm on the surface; triangle (q,) as the tree numbers them;
    barycentric (q, 3); signed (q,) mm, positive outside; part (q,) of the triangle: 0 inside, 1..3 corner, 4..6 edge 01, 12, 20.
    """

    distance: FloatArray
    point: FloatArray
    triangle: IntArray
    barycentric: FloatArray
    signed: FloatArray
    part: IntArray


def closest_points(tree: TriangleTree, x: FloatArray) -> ClosestPoints:
    """Closest points of x (q, 3) mm. Neighbours in x should be near each other: each search starts from the last answer."""
    x = np.ascontiguousarray(x, dtype=np.float64).reshape(-1, 3)
    q = len(x)
    barycentric, squared = np.empty((q, 3)), np.empty(q)
    triangle, part = np.empty(q, dtype=np.int64), np.empty(q, dtype=np.int64)

    def search(first: int) -> None:
        rows = slice(first, first + _IN_A_ROW)
        _search(
            x[rows], tree.corners, tree.boxes, tree.order, barycentric[rows], squared[rows], triangle[rows], part[rows]
        )

    in_threads(search, range(0, q, _IN_A_ROW))
    point = np.einsum("qk,qki->qi", barycentric, tree.corners[triangle])
    distance = np.sqrt(squared)
    side = np.einsum("qi,qi->q", x - point, tree.normals[triangle, part])
    return ClosestPoints(distance, point, triangle, barycentric, np.where(side < 0.0, -distance, distance), part)


@njit(cache=True, error_model="numpy", nogil=True)
def _search(
    x: FloatArray,
    corners: FloatArray,
    boxes: FloatArray,
    order: IntArray,
    barycentric: FloatArray,
    squared: FloatArray,
    triangle: IntArray,
    part: IntArray,
) -> None:
    """Depth first, nearer child first, branches farther than the best so far cut off."""
    n_leaves, leaf = order.shape
    stack = np.empty(64, dtype=np.int64)
    gap = np.empty(64)
    last = order[0, 0]
    for q in range(x.shape[0]):
        px, py, pz = x[q]
        best_face = last
        best, b0, b1, b2, best_part = _closest_in_triangle(px, py, pz, corners[last])
        stack[0], gap[0] = 0, 0.0
        top = 1
        while top > 0:
            top -= 1
            node = stack[top]
            if gap[top] >= best:
                continue
            if node >= n_leaves - 1:
                for k in range(leaf):
                    face = order[node - n_leaves + 1, k]
                    d, c0, c1, c2, where = _closest_in_triangle(px, py, pz, corners[face])
                    if d < best:
                        best, b0, b1, b2, best_part, best_face = d, c0, c1, c2, where, face
                continue
            child = 2 * node + 1
            to_left, to_right = _to_box(px, py, pz, boxes[child]), _to_box(px, py, pz, boxes[child + 1])
            near = child if to_left <= to_right else child + 1
            stack[top], gap[top] = 2 * child + 1 - near, max(to_left, to_right)
            stack[top + 1], gap[top + 1] = near, min(to_left, to_right)
            top += 2
        barycentric[q, 0], barycentric[q, 1], barycentric[q, 2] = b0, b1, b2
        squared[q], triangle[q], part[q] = best, best_face, best_part
        last = best_face


@njit(cache=True, error_model="numpy")
def _to_box(px: float, py: float, pz: float, box: FloatArray) -> float:
    """Squared distance of a point from a box, 0 inside."""
    dx = max(box[0] - px, 0.0, px - box[3])
    dy = max(box[1] - py, 0.0, py - box[4])
    dz = max(box[2] - pz, 0.0, pz - box[5])
    return dx * dx + dy * dy + dz * dz


@njit(cache=True, error_model="numpy")
def _closest_in_triangle(px: float, py: float, pz: float, t: FloatArray) -> tuple[float, float, float, float, int]:
    """Squared distance, barycentric coordinates and part (see ClosestPoints) of the closest point in triangle t (3, 3)."""
    b0, b1, b2, part = _project(px, py, pz, t)
    dx = px - (b0 * t[0, 0] + b1 * t[1, 0] + b2 * t[2, 0])
    dy = py - (b0 * t[0, 1] + b1 * t[1, 1] + b2 * t[2, 1])
    dz = pz - (b0 * t[0, 2] + b1 * t[1, 2] + b2 * t[2, 2])
    return dx * dx + dy * dy + dz * dz, b0, b1, b2, part


@njit(cache=True, error_model="numpy")
def _project(px: float, py: float, pz: float, t: FloatArray) -> tuple[float, float, float, int]:
    """Voronoi regions of corners first, then of edges, then the inside."""
    d1, d2 = _along(px, py, pz, t, 0)
    if d1 <= 0.0 and d2 <= 0.0:
        return 1.0, 0.0, 0.0, 1
    d3, d4 = _along(px, py, pz, t, 1)
    if d3 >= 0.0 and d4 <= d3:
        return 0.0, 1.0, 0.0, 2
    vc = d1 * d4 - d3 * d2
    if vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        s = d1 / (d1 - d3)
        return 1.0 - s, s, 0.0, 4
    d5, d6 = _along(px, py, pz, t, 2)
    if d6 >= 0.0 and d5 <= d6:
        return 0.0, 0.0, 1.0, 3
    vb = d5 * d2 - d1 * d6
    if vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        s = d2 / (d2 - d6)
        return 1.0 - s, 0.0, s, 6
    va = d3 * d6 - d5 * d4
    if va <= 0.0 and d4 >= d3 and d5 >= d6:
        s = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        return 0.0, 1.0 - s, s, 5
    scale = 1.0 / (va + vb + vc)
    return va * scale, vb * scale, vc * scale, 0


@njit(cache=True, error_model="numpy")
def _along(px: float, py: float, pz: float, t: FloatArray, k: int) -> tuple[float, float]:
    """(p - corner k) along edges 01 and 02."""
    rx, ry, rz = px - t[k, 0], py - t[k, 1], pz - t[k, 2]
    along_1 = (t[1, 0] - t[0, 0]) * rx + (t[1, 1] - t[0, 1]) * ry + (t[1, 2] - t[0, 2]) * rz
    along_2 = (t[2, 0] - t[0, 0]) * rx + (t[2, 1] - t[0, 1]) * ry + (t[2, 2] - t[0, 2]) * rz
    return along_1, along_2
