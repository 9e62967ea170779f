"""Motions of points: rigid about a pivot, affine by a matrix."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.core.arrays import FloatArray

# Rest positions (n, 3) mm -> displacements (n, 3) mm.
Motion = Callable[[FloatArray], FloatArray]


def rigid_motion(X: FloatArray, pivot: FloatArray, phi: FloatArray) -> FloatArray:
    """Displacements (n, 3) mm at X (n, 3) mm: translation phi[:3] mm and rotation vector phi[3:] degrees about the pivot (3,) mm."""
    rotated = Rotation.from_rotvec(phi[3:], degrees=True).apply(X - pivot)
    return np.asarray(rotated + pivot - X + phi[:3])


def transformed(matrix: FloatArray, points: FloatArray) -> FloatArray:
    """Points (n, 3) mm after the affine map of a matrix (4, 4): x -> A x + t."""
    return np.asarray(points @ matrix[:3, :3].T + matrix[:3, 3], dtype=np.float64)
