"""Compiled loop of the contact between a rigid sphere and a triangulated surface: a penalty on the gap at points of its
faces.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.terms.base import triangle_quadrature

POINTS, WEIGHTS = triangle_quadrature(4)


@njit(cache=True)
def sphere_blocks(
    rows: IntArray,
    faces: IntArray,
    area: FloatArray,
    x: FloatArray,
    centre: FloatArray,
    radius: float,
    stiffness: FloatArray,
    deepest: FloatArray,
    points: FloatArray,
    weights: FloatArray,
    energy: FloatArray,
    gradient: FloatArray,
    hessian: FloatArray,
) -> None:
    """For the faces `rows` (r,): energy (r,), its gradient (r, 9) and second derivative (r, 9, 9) over their corners;
    zero without contact.

    faces : (f, 3) into x (s, 3), where the nodes are, mm. area : (f,) mm2 at rest. stiffness : (f,) kPa/mm. hessian of
    no length: left out. deepest : (f,) mm; farther inside than in any equilibrium, the curvature of the gap counts as
    at this depth: it would make the first steps' matrix indefinite.
    """
    second = hessian.shape[0] > 0
    at = np.empty(3)
    for row in range(rows.shape[0]):
        face = rows[row]
        energy[row] = 0.0
        gradient[row] = 0.0
        if second:
            hessian[row] = 0.0
        for q in range(points.shape[0]):
            length = 0.0
            for d in range(3):
                at[d] = -centre[d]
                for c in range(3):
                    at[d] += points[q, c] * x[faces[face, c], d]
                length += at[d] * at[d]
            length = np.sqrt(length)
            gap = length - radius
            if gap >= 0.0:
                continue
            k = stiffness[face] * weights[q] * area[face]
            energy[row] += 0.5 * k * gap * gap
            bend = k * max(gap, -deepest[face]) / length
            for a in range(3):
                for d in range(3):
                    gradient[row, 3 * a + d] += k * gap * points[q, a] * at[d] / length
            if not second:
                continue
            for a in range(3):
                for b in range(3):
                    share = points[q, a] * points[q, b]
                    for d in range(3):
                        for e in range(3):
                            nn = at[d] * at[e] / (length * length)
                            hessian[row, 3 * a + d, 3 * b + e] += share * (
                                k * nn + bend * ((1.0 if d == e else 0.0) - nn)
                            )
