"""How far the true effect closes the gap in truth: distances to surfaces without noise, which only the answers hold."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.observe.contour_noise import noise_modes
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree

# What changes along the surface faster than this, mm, is voxels, and left out; share of the variance of so smooth a field that is kept.
_LENGTH_MM, _SHARE = 8.0, 0.99


def achieved(
    maps: Mapping[str, FloatArray], true: Mapping[str, FloatArray | IntArray], effect: str
) -> tuple[float, float, float] | None:
    """Share of the plain model's true error that `effect` takes away, and both errors, rms mm; None when it was not refitted.

    maps : of a diagnosis, further deformed states under `state_2/` and so on. true : points (k, 3) mm and faces (f, 3) of the organ as
    the deformed scan would show it without noise, at_rest (k, 3) mm, the same at rest, and points_2 (k, 3) mm and so on of further
    states. Errors are over all states that both hold. Every prediction starts from the contour at rest and carries its noise, which is no
    error of the model's: how far that contour lies outside the true organ is taken off.
    """
    if f"predicted/{effect}" not in maps:
        return None
    smooth = _modes(maps["points"])
    drawn = closest_points(_tree(true, "at_rest"), maps["points"]).signed
    states = []
    for prefix, points in _states(maps, true, effect).items():
        after = _tree(true, points)
        errors = []
        for name in ("plain", effect):
            off = closest_points(after, maps[f"{prefix}predicted/{name}"]).signed - drawn
            off = off + maps[f"{prefix}correction/{name}"] + maps[f"{prefix}offset/{name}"][0]
            errors.append(float(np.linalg.norm(smooth.T @ off) / np.sqrt(len(off))))
        states.append(errors)
    before, left = (float(np.linalg.norm(errors) / np.sqrt(len(states))) for errors in zip(*states, strict=True))
    return 1.0 - left / max(before, 1e-12), before, left


def _states(maps: Mapping[str, FloatArray], true: Mapping[str, FloatArray | IntArray], effect: str) -> dict[str, str]:
    """Prefix in maps -> name in true of every deformed state's surface."""
    found = {"": "points"}
    for name in true:
        prefix = f"state_{name.removeprefix('points_')}/"
        if name.startswith("points_") and {f"{prefix}predicted/plain", f"{prefix}predicted/{effect}"} <= set(maps):
            found[prefix] = name
    return found


def _tree(true: Mapping[str, FloatArray | IntArray], points: str) -> TriangleTree:
    return TriangleTree.of(np.asarray(true[points], dtype=np.float64), np.asarray(true["faces"], dtype=np.int64))


def _modes(points: FloatArray) -> FloatArray:
    """(q, m) orthonormal, smooth along a surface with these points (q, 3) mm."""
    modes = noise_modes(points, 1.0, _LENGTH_MM, _SHARE)
    return np.asarray(modes / np.linalg.norm(modes, axis=0))
