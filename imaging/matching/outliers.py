"""Points whose match cannot be right: told by matching back, by what is left of the difference, and by their neighbours."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.imaging.matching.local_matching import LocalMatches

# Squared standard deviations beyond which matching back, or the neighbours, contradict a point: chi-squared of three
# degrees of freedom exceeds the second with a probability of 1e-4.
_BACK, _NEIGHBOURS = 9.0, 21.1
# Robust standard deviations of ln(left difference) beyond which a window differs by more than its noise.
_LEFT = 4.0
# Neighbours that are asked, and by how much tissue may move otherwise than they do (sliding, uneven strain), mm.
_ASKED, _UNEVEN_MM = 16, 1.0


def reasons(found: LocalMatches, back: FloatArray) -> IntArray:
    """Why each point is not used (n,): an index of `core.matched_motion.REASONS`, 0 for a good one.

    back : (n, 3) mm, displacement there and back again; 0 where both agree.
    """
    out = np.zeros(len(found.points), dtype=np.int64)
    for number, bad in ((3, _unlike_neighbours(found)), (2, _left_too_much(found)), (1, _not_back(found, back))):
        out[bad] = number
    return out


def _not_back(found: LocalMatches, back: FloatArray) -> BoolArray:
    return np.asarray(np.einsum("ni,nij,nj->n", back, found.cautious, back) > _BACK)


def _left_too_much(found: LocalMatches) -> BoolArray:
    size = np.log(np.maximum(found.left_hu, 1e-3))
    middle = np.median(size) if len(size) else 0.0
    spread = 1.4826 * np.median(np.abs(size - middle)) if len(size) else 1.0
    return np.asarray(size - middle > _LEFT * max(float(spread), 0.05))


def _unlike_neighbours(found: LocalMatches) -> BoolArray:
    """Against the affine motion that fits a point's neighbours, each weighed by its cautious precision and the unevenness."""
    count = min(_ASKED + 1, len(found.points))
    if count < _ASKED // 2:
        return np.zeros(len(found.points), dtype=bool)
    _, near = cKDTree(found.points).query(found.points, k=count)
    P = found.cautious @ np.linalg.inv(np.eye(3) + _UNEVEN_MM**2 * found.cautious)
    square = np.empty(len(found.points))
    for i, others in enumerate(near[:, 1:]):
        away = (found.points[others] - found.points[i]) / 10.0
        design = np.einsum("kc,ij->kicj", np.column_stack([np.ones(len(others)), away]), np.eye(3)).reshape(-1, 3, 12)
        H = np.einsum("kia,kij,kjb->ab", design, P[others], design) + np.diag(np.repeat([1e-6, 1.0, 1.0, 1.0], 3))
        right = np.einsum("kia,kij,kj->a", design, P[others], found.displacement[others])
        unlike = found.displacement[i] - np.linalg.solve(H, right)[:3]
        square[i] = unlike @ P[i] @ unlike
    return np.asarray(square > _NEIGHBOURS)
