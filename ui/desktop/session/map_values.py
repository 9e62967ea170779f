"""The stiffness map of a case at points of its organ."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.identify.map.stiffness_map import nearest_patch, painted


def map_at(
    arrays: Mapping[str, NDArray[np.generic]],
    points: FloatArray,
    factor: float | None,
    labels: IntArray | None = None,
) -> tuple[FloatArray, BoolArray]:
    """G (n,) kPa of the map at points (n, 3) mm of the organ at rest with labels (n,), and where it tells it, to the factor
    asked for."""
    if not len(points):
        return np.zeros(0), np.zeros(0, dtype=bool)
    G, told = painted(arrays, points, labels)
    if factor is not None:
        told = told & (np.exp(1.96 * np.asarray(arrays["sd"])[nearest_patch(arrays, points, labels)]) <= factor)
    return G, told
