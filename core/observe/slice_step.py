"""Whether bones lie aside in all slices above a level: the mark of a patient who moved while the scan was taken."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray

# Levels that are tried, as shares of the points that lie below each: between the first and the last, so many.
_FIRST, _LAST, _LEVELS = 0.1, 0.9, 17


@dataclass(frozen=True)
class SliceStep:
    """The step that explains most. share : of the squares of what one rigid motion leaves. level_mm : height (LPS) of it.
    aside_mm : how far the slices above lie from where those below have them, in their plane.
    """

    share: float
    level_mm: float
    aside_mm: float


def slice_step(points: FloatArray, design: FloatArray, misfit: FloatArray) -> SliceStep:
    """The step in what a rigid motion leaves of bones.

    points : (q, 3) mm. design : (q, 6) takes a rigid motion to distances along the normals, the first three columns
    being the normals. misfit : (q,) mm, distances left. Slices are taken to be axial; the rigid motion is found anew with the step.
    """
    found = SliceStep(0.0, float(points[:, 2].mean()), 0.0)
    whole = float(misfit @ misfit)
    if not whole > 0.0:
        return found
    for level in np.quantile(points[:, 2], np.linspace(_FIRST, _LAST, _LEVELS)):
        above = (points[:, 2] > level).astype(float)[:, None]
        both = np.hstack([design, above * design[:, :2]])
        fitted = np.linalg.lstsq(both, misfit, rcond=None)[0]
        left = misfit - both @ fitted
        share = 1.0 - float(left @ left) / whole
        if share > found.share:
            found = SliceStep(share, float(level), float(np.linalg.norm(fitted[-2:])))
    return found
