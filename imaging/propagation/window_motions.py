"""Components of the motion that small windows about the organs see, each with its variance."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.matching.local_matching import centre_of_texture
from palpate.imaging.matching.window_errors import one_step, texture_and_precision, variance_left
from palpate.imaging.matching.window_fits import equations_under
from palpate.imaging.matching.window_sums import Windows
from palpate.imaging.propagation.smooth_motion import SmoothMotion

# Least share of a window that must be usable, and the largest variance, mm2, of a component that is used.
_FULL, _MOST_MM2 = 0.3, 1.0


@dataclass(frozen=True, eq=False)
class WindowMotions:
    """points (n, 3) mm. directions (n, 3) unit. along_mm (n,) displacement along it. variance_mm2 (n,)."""

    points: FloatArray
    directions: FloatArray
    along_mm: FloatArray
    variance_mm2: FloatArray

    def chosen(self, keep: BoolArray) -> WindowMotions:
        """Some of them."""
        return WindowMotions(self.points[keep], self.directions[keep], self.along_mm[keep], self.variance_mm2[keep])

    def at_most(self, count: int) -> WindowMotions:
        """Evenly drawn from all, at most so many; the same ones each time."""
        n = len(self.points)
        if n <= count:
            return self
        keep = np.zeros(n, dtype=bool)
        keep[np.random.default_rng(0).permutation(n)[:count]] = True
        return self.chosen(keep)


def window_motions(smooth: SmoothMotion, window_mm: float, apart_mm: float) -> WindowMotions:
    """Of every window that is full enough: its displacement along each principal direction of its precision.

    An edge tells its normal only; directions that a window does not tell are left out.
    """
    pair = replace(smooth.pair, windows=Windows.of(smooth.pair.grid, window_mm, apart_mm))
    nodes = pair.windows.nodes
    at = equations_under(pair, *pair.moved(smooth.motion.at(nodes.reshape(-1, 3)).reshape(nodes.shape)))
    keep = pair.windows.sum(at.weight) > _FULL
    texture, precision, _ = texture_and_precision(pair, at, variance_left(pair, at))
    centre = centre_of_texture(pair, at, keep)
    moved = smooth.motion.at(centre) + one_step(texture[keep], at.right[keep], precision[keep])
    value, vector = np.linalg.eigh(precision[keep])
    window, axis = np.nonzero(value > 1.0 / _MOST_MM2)
    direction = vector[window, :, axis]
    along = np.einsum("na,na->n", direction, moved[window])
    return WindowMotions(centre[window], direction, along, 1.0 / value[window, axis])
