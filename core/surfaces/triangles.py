"""Triangles in closed form: area vectors, areas, normals, enclosed volume."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray

# Triangles smaller than this, mm2, have no normal; it keeps a needle's zero vector from becoming NaN.
_NO_AREA = 1e-300


def area_vectors(corners: FloatArray) -> FloatArray:
    """Area times unit normal (..., 3) mm2 of triangles with corners (..., 3, 3) mm, by the right-hand rule."""
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    return np.asarray(0.5 * np.cross(b - a, c - a), dtype=np.float64)


def areas(corners: FloatArray) -> FloatArray:
    """Areas (...) mm2 of triangles with corners (..., 3, 3) mm."""
    return np.asarray(np.linalg.norm(area_vectors(corners), axis=-1), dtype=np.float64)


def normals(corners: FloatArray) -> FloatArray:
    """Unit normals (..., 3) of triangles with corners (..., 3, 3) mm, by the right-hand rule; zero for a needle."""
    return unit(area_vectors(corners))


def point_normals(points: FloatArray, faces: IntArray) -> FloatArray:
    """Unit normals (n, 3) at points (n, 3) mm: the area-weighted mean of the faces (f, 3) around each; zero where there are none.

    Quadratic faces (f, 6) count by their corners, which come first, and give their mid-edge nodes a normal too.
    """
    vectors = area_vectors(points[faces[:, :3]])
    total = np.zeros_like(points, dtype=np.float64)
    for column in faces.T:
        np.add.at(total, column, vectors)
    return unit(total)


def enclosed_volume(points: FloatArray, faces: IntArray) -> float:
    """Volume, mm3, inside a closed surface whose normals look outwards, by the divergence theorem.

    Negative where normals look inwards; means nothing for an open surface.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.einsum("fi,fi->f", a, np.cross(b, c)).sum()) / 6.0


def unit(vectors: FloatArray) -> FloatArray:
    """Vectors (..., 3) of length one; zero stays zero."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _NO_AREA), dtype=np.float64)
