"""Shape of tetrahedra: dihedral angles, radius ratio, and one figure of both.

Compiled cell by cell: `meshing.improve` asks for a few cells at a time, thousands of times.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import FACES_OF_CELL

_NO_LENGTH = 1e-300  # keeps the zero normal of a needle from becoming NaN
_NO_RADIUS = 1e-30


def dihedral_angles(points: FloatArray, cells: IntArray) -> FloatArray:
    """The six angles (m, 6) in degrees between the faces of each cell."""
    return _degrees(_measured(points, cells)[0])


def radius_ratio(points: FloatArray, cells: IntArray) -> FloatArray:
    """Three times inscribed over circumscribed radius (m,): 1 for a regular cell, 0 for a flat one."""
    return _measured(points, cells)[1]


def shape(points: FloatArray, cells: IntArray) -> FloatArray:
    """One figure of shape (m,) in degrees: how far a cell's angles stay from 0 and 180, and its radius ratio times 120.

    A regular cell has 70. A cell with four points near a circle can have fair angles and a radius ratio near zero.
    """
    cosines, ratio = _measured(points, cells)
    smallest, largest = _degrees(cosines.max(axis=1)), _degrees(cosines.min(axis=1))
    return np.asarray(np.minimum(np.minimum(smallest, 180.0 - largest), 120.0 * ratio))


def _degrees(cosines: FloatArray) -> FloatArray:
    return np.asarray(np.degrees(np.arccos(np.clip(cosines, -1.0, 1.0))))


def _measured(points: FloatArray, cells: IntArray) -> tuple[FloatArray, FloatArray]:
    """Cosines (m, 6) of the dihedral angles, and radius ratios (m,)."""
    cosines, ratio = np.empty((len(cells), 6)), np.empty(len(cells))
    _measure(points, cells, FACES_OF_CELL, cosines, ratio)
    return cosines, ratio


@njit(cache=True)
def _measure(points: FloatArray, cells: IntArray, faces: IntArray, cosines: FloatArray, ratio: FloatArray) -> None:
    """Into cosines (m, 6) and ratio (m,) of cells (m, 4); faces (4, 3) : corners of a cell's faces, normals outwards."""
    normal, edge, square, vector = np.empty((4, 3)), np.empty((3, 3)), np.empty(3), np.empty(3)
    for e in range(cells.shape[0]):
        area = 0.0
        for f in range(4):
            for k in range(3):
                origin = points[cells[e, faces[f, 0]], k]
                edge[0, k] = points[cells[e, faces[f, 1]], k] - origin
                edge[1, k] = points[cells[e, faces[f, 2]], k] - origin
            _cross(edge[0], edge[1], vector)
            length = np.sqrt(_dot(vector, vector))
            area += 0.5 * length
            for k in range(3):
                normal[f, k] = vector[k] / max(length, _NO_LENGTH)
        pair = 0
        for f in range(4):
            for g in range(f + 1, 4):
                cosines[e, pair] = -_dot(normal[f], normal[g])
                pair += 1
        for i in range(3):
            for k in range(3):
                edge[i, k] = points[cells[e, i + 1], k] - points[cells[e, 0], k]
            square[i] = _dot(edge[i], edge[i])
        ratio[e] = _radius_ratio(edge, square, area, vector)


@njit(cache=True)
def _radius_ratio(edge: FloatArray, square: FloatArray, area: float, vector: FloatArray) -> float:
    """Of a cell with edges (3, 3) mm from its first corner, their squared lengths (3,) and this area of surface, mm2."""
    top0 = top1 = top2 = 0.0
    for i in range(3):
        _cross(edge[(i + 1) % 3], edge[(i + 2) % 3], vector)
        top0 += square[i] * vector[0]
        top1 += square[i] * vector[1]
        top2 += square[i] * vector[2]
    _cross(edge[0], edge[1], vector)
    six_volume = abs(_dot(vector, edge[2]))
    radius = max(np.sqrt(top0 * top0 + top1 * top1 + top2 * top2), _NO_RADIUS)
    return 3.0 * six_volume**2 / (area * radius)


@njit(cache=True)
def _cross(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@njit(cache=True)
def _dot(a: FloatArray, b: FloatArray) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
