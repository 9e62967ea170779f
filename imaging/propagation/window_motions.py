"""Components of the motion that small windows about the organs see, each with its variance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.matching.local_matching import centre_of_texture
from palpate.imaging.matching.window_errors import one_step, texture_and_precision, variance_left
from palpate.imaging.matching.window_fits import equations_under
from palpate.imaging.matching.window_sums import Windows
from palpate.imaging.propagation.displacements import Displacements
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.propagation.smooth_motion import SmoothMotion

# Least share of a window that must be usable, and the largest variance, mm2, of a component that is used.
_FULL, _MOST_MM2 = 0.3, 1.0


def window_motions(smooth: SmoothMotion, options: PropagationOptions) -> Displacements:
    """Of every window that is full enough: its displacement along each principal direction of its precision.

    An edge tells its normal only; directions that a window does not tell are left out.
    """
    pair = replace(smooth.pair, windows=Windows.of(smooth.pair.grid, options.window_mm, options.apart_mm))
    nodes = pair.windows.nodes
    at = equations_under(pair, *pair.moved(smooth.motion.at(nodes.reshape(-1, 3)).reshape(nodes.shape)))
    keep = pair.windows.sum(at.weight) > _FULL
    texture, precision, _ = texture_and_precision(pair, at, variance_left(pair, at))
    centre = centre_of_texture(pair, at, keep)
    moved = smooth.motion.at(centre) + one_step(texture[keep], at.right[keep], precision[keep])
    return along_axes(centre, moved, precision[keep], options.strain * options.window_mm)


def along_axes(points: FloatArray, moved: FloatArray, precision: FloatArray, strained_mm: float) -> Displacements:
    """Of displacements moved (n, 3) mm with precisions (n, 3, 3) 1/mm2, those along the principal directions that are told.

    A window's motion is a mean over it. strained_mm : what strain leaves of that, strain times the window's size; it counts as noise.
    """
    value, vector = np.linalg.eigh(precision)
    window, axis = np.nonzero(value > 1.0 / _MOST_MM2)
    direction = vector[window, :, axis]
    along = np.einsum("na,na->n", direction, moved[window])
    return Displacements(points[window], direction, along, 1.0 / value[window, axis] + strained_mm**2)
