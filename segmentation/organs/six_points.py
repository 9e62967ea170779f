"""What the six outermost points of an organ say of its shape (extreme points: Papadopoulos et al., ICCV 2017)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.segmentation.organs.scene import Scene
from palpate.segmentation.organs.star import sphere

FloatArray = NDArray[np.float64]

# How much of the tilt that the points show is believed: a point may lie anywhere on a flat side.
TILT_TRUST, MOST_TILT = 0.7, 0.6


@dataclass(frozen=True, eq=False)
class Ellipsoid:
    """centre : (3,) mm. semi : (3,) mm half the extent along LPS. matrix : (3, 3) mm2, its shape."""

    centre: FloatArray
    semi: FloatArray
    matrix: FloatArray

    def level(self, scene: Scene) -> FloatArray:
        """0 at the centre, 1 on the surface, on the scene's grid."""
        away = np.stack(np.broadcast_arrays(*scene.axes()), axis=-1) - self.centre
        whiten = np.linalg.inv(np.linalg.cholesky(self.matrix))
        return np.asarray(np.linalg.norm(away @ whiten.T, axis=-1))

    def radii(self) -> FloatArray:
        """Radii (642,) mm along the directions of `star.sphere`."""
        directions = sphere().points
        return 1.0 / np.sqrt(np.einsum("ni,ij,nj->n", directions, np.linalg.inv(self.matrix), directions))


def ellipsoid_of(points: FloatArray) -> Ellipsoid:
    """The ellipsoid whose outermost points along x, y and z are the given ones (6, 3) mm, in any order.

    An ellipsoid of shape A is outermost along axis i at A[:, i] / sqrt(A[i, i]): the points give extent and tilt.
    """
    low, high = points[points.argmin(axis=0)], points[points.argmax(axis=0)]
    centre, semi = 0.5 * (np.diag(low) + np.diag(high)), 0.5 * (np.diag(high) - np.diag(low))
    tilt = 0.25 * semi[:, None] * (high - low)
    most = MOST_TILT * np.outer(semi, semi)
    matrix = np.clip(TILT_TRUST * (tilt + tilt.T), -most, most)
    np.fill_diagonal(matrix, semi**2)
    # Three tilts that do not go together make no ellipsoid: they are lessened until they do.
    while np.linalg.eigvalsh(matrix).min() < 0.05 * (semi**2).min():
        matrix = 0.8 * matrix + 0.2 * np.diag(semi**2)
    return Ellipsoid(centre, semi, matrix)
