"""How far the true effect closes the gap in truth: distances to surfaces without noise, which only the answers hold."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.observe.closest_point import closest_points
from palpate.core.observe.noise import noise_modes
from palpate.core.observe.triangle_tree import TriangleTree
from palpate.segmentation.smooth_field import FloatArray

# What changes along the surface faster than this, mm, is voxels, and left out; share of the variance of so smooth a field that is kept.
_LENGTH_MM, _SHARE = 7.0, 0.99


def achieved(
    maps: Mapping[str, NDArray[Any]], true: Mapping[str, NDArray[Any]], effect: str
) -> tuple[float, float, float] | None:
    """Share of the plain model's true error that `effect` takes away, and both errors, rms mm; None when it was not refitted.

    maps : of a diagnosis. true : points (k, 3) mm and faces (f, 3) of the organ as the deformed scan would show it without noise, and
    at_rest (k, 3) mm, the same at rest. Every prediction starts from the contour at rest and carries its noise, which is no error of
    the model's: how far that contour lies outside the true organ is taken off.
    """
    if f"predicted/{effect}" not in maps:
        return None
    after, before = (TriangleTree.of(np.asarray(true[key]), np.asarray(true["faces"])) for key in ("points", "at_rest"))
    smooth = _modes(maps["points"])
    drawn = closest_points(before, maps["points"]).signed
    errors = []
    for name in ("plain", effect):
        off = closest_points(after, maps[f"predicted/{name}"]).signed - drawn
        off = off + maps["correction_mm"] + maps[f"offset/{name}"][0]
        errors.append(float(np.linalg.norm(smooth.T @ off) / np.sqrt(len(off))))
    return 1.0 - errors[1] / max(errors[0], 1e-12), errors[0], errors[1]


def _modes(points: FloatArray) -> FloatArray:
    """(q, m) orthonormal, smooth along a surface with these points (q, 3) mm."""
    modes = noise_modes(points, 1.0, _LENGTH_MM, _SHARE)
    return np.asarray(modes / np.linalg.norm(modes, axis=0))
