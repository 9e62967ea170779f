"""Contours of one scan carried over to another scan of the same patient (contour propagation)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.worker.progress import Progress, silent
from palpate.imaging.propagation.compared_scans import HOLLOW, DrawnScan, bounds_of
from palpate.imaging.propagation.motion_prior import SurfacePoints, Walls
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.propagation.smooth_motion import smooth_motion
from palpate.imaging.propagation.tissue_motion import TissueMotion, tissue_motion
from palpate.imaging.propagation.window_motions import window_motions
from palpate.imaging.volume import Volume

# How far about the organs the motion is given, mm.
_ROOM_MM = 12.0


@dataclass(frozen=True, eq=False)
class Propagation:
    """motion : from the drawn scan to the other one, with its error. field : the same on a lattice about the organs,
    (mi, mj, mk, 3) mm. alike : correlation of both images under it."""

    motion: TissueMotion
    field: Volume
    alike: float


def propagation(
    drawn: DrawnScan,
    other: Volume,
    surfaces: Mapping[str, SurfacePoints],
    options: PropagationOptions | None = None,
    progress: Progress = silent,
) -> Propagation | None:
    """The motion that carries contours over; None where both images do not agree under any.

    drawn, other : in one frame. surfaces : of the drawn organs, by name. Raises InputError where the scans do not overlap
    about the contours.
    """
    options = options or PropagationOptions()
    progress(0.0, "matching both scans")
    smooth = smooth_motion(drawn, other, options)
    alike = smooth.alike
    if alike < options.least_alike:
        return None
    progress(0.5, "motion of the organs' surfaces")
    seen = window_motions(smooth, options.window_mm, options.apart_mm)
    tree = cKDTree(np.vstack([surface.points for surface in surfaces.values()]))
    seen = seen.chosen(tree.query(seen.points)[0] < options.reach_mm)
    walls = Walls([surfaces[name] for name in HOLLOW if name in surfaces], options.wall_fade_mm)
    motion = tissue_motion(seen, walls, options)
    low, high = bounds_of(drawn.organs.values())
    field = motion.on_lattice(low - _ROOM_MM, high + _ROOM_MM, options.grid_mm)
    progress(1.0, "motion found")
    return Propagation(motion, field, alike)
