"""Where a triangle surface runs through itself: edges that pierce triangles they share no point with."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import BoolArray, FloatArray, IntArray

# Pairs of near triangles beyond which the search is given up: a surface with very unequal triangles.
_MOST_PAIRS = 6_000_000


def crossings(points: FloatArray, faces: IntArray) -> IntArray | None:
    """Faces (c,) that an edge of another face pierces; None where looking would take too long."""
    X = points[faces]
    centre = X.mean(axis=1)
    reach = np.linalg.norm(X - centre[:, None], axis=2).max(axis=1)
    tree = cKDTree(centre)
    if tree.count_neighbors(tree, 2.0 * float(reach.max())) > 2 * _MOST_PAIRS:
        return None
    a, b = tree.query_pairs(2.0 * float(reach.max()), output_type="ndarray").T
    near = np.linalg.norm(centre[a] - centre[b], axis=1) < reach[a] + reach[b]
    apart = ~(faces[a][:, :, None] == faces[b][:, None, :]).any(axis=(1, 2))
    a, b = a[near & apart], b[near & apart]
    pierced = [_pierces(X[one], X[other]) for one, other in ((a, b), (b, a))]
    return np.unique(np.concatenate([b[pierced[0]], a[pierced[1]]]))


def _pierces(edges_of: FloatArray, triangle: FloatArray) -> BoolArray:
    """(p,) whether an edge of the first triangle (p, 3, 3) passes through the inside of the second (p, 3, 3)."""
    u, v = triangle[:, 1] - triangle[:, 0], triangle[:, 2] - triangle[:, 0]
    normal = np.cross(u, v)
    height = np.einsum("pki,pi->pk", edges_of - triangle[:, :1], normal)
    hit = np.zeros(len(triangle), dtype=bool)
    for k in range(3):
        h0, h1 = height[:, k], height[:, (k + 1) % 3]
        passes = h0 * h1 < 0.0
        share = h0 / np.where(passes, h0 - h1, 1.0)
        x = edges_of[:, k] + share[:, None] * (edges_of[:, (k + 1) % 3] - edges_of[:, k])
        hit |= passes & _inside(x, triangle, normal)
    return hit


def _inside(x: FloatArray, triangle: FloatArray, normal: FloatArray) -> BoolArray:
    inside = np.ones(len(x), dtype=bool)
    for k in range(3):
        side = triangle[:, (k + 1) % 3] - triangle[:, k]
        inside &= np.einsum("pi,pi->p", np.cross(side, x - triangle[:, k]), normal) > 0.0
    return inside
