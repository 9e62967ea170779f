"""How far the true effect closes the gap in truth: distances to the surface without noise, which only the answers hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.observe.closest_point import closest_points
from palpate.core.observe.triangle_tree import TriangleTree
from palpate.segmentation.smooth_field import FloatArray, IntArray


def achieved(
    maps: Mapping[str, NDArray[Any]], points: FloatArray, faces: IntArray, effect: str, noise_mm: float
) -> tuple[float, float, float] | None:
    """Share of the plain model's true error that `effect` takes away, and both errors, rms mm; None when it was not refitted.

    maps : of a diagnosis. points (k, 3) mm, faces (f, 3) : the organ as the deformed scan would show it without noise. noise_mm : of
    one contour. Every prediction starts from the contour at rest and carries its noise, which no effect can take away: errors are
    what is above it, as in the share that a diagnosis states.
    """
    if f"predicted/{effect}" not in maps:
        return None
    tree = TriangleTree.of(points, faces)
    errors = []
    for name in ("plain", effect):
        distance = closest_points(tree, maps[f"predicted/{name}"]).signed
        off = distance + maps["correction_mm"] + maps[f"offset/{name}"][0]
        errors.append(float(np.sqrt(max((off**2).mean() - noise_mm**2, 0.0))))
    return 1.0 - errors[1] / max(errors[0], 1e-12), errors[0], errors[1]
