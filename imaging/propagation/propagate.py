"""Contours of one scan carried over to another scan of the same patient (contour propagation)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.propagation.compared_scans import HOLLOW, DrawnScan, bounds_of
from palpate.imaging.propagation.motion_prior import SurfacePoints, Walls
from palpate.imaging.propagation.options import PropagationOptions
from palpate.imaging.propagation.smooth_motion import smooth_motion
from palpate.imaging.propagation.tissue_motion import TissueMotion, tissue_motion
from palpate.imaging.propagation.window_motions import window_motions
from palpate.imaging.volume import Volume

# How far about the organs the motion is given, and how far from their surfaces it is that of its own place, mm: three nodes.
_ROOM_MM, _NEAR_MM = 12.0, 9.0
# Nodes that are asked at once: the covariance with all windows stays in the processor's cache.
_AT_ONCE = 200


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
    seen = window_motions(smooth, options)
    tree = cKDTree(np.vstack([surface.points for surface in surfaces.values()]))
    seen = seen.chosen(tree.query(seen.points)[0] < options.reach_mm)
    walls = Walls([surfaces[name] for name in HOLLOW if name in surfaces], options.wall_fade_mm)
    motion = tissue_motion(seen, walls, options)
    low, high = bounds_of(drawn.organs.values())
    field = _on_lattice(motion, tree, low - _ROOM_MM, high + _ROOM_MM, options.grid_mm)
    progress(1.0, "motion found")
    return Propagation(motion, field, alike)


def _on_lattice(motion: TissueMotion, surfaces: cKDTree, low: FloatArray, high: FloatArray, step_mm: float) -> Volume:
    """Displacements (mi, mj, mk, 3) mm on a lattice over a box, quickly asked. A node that is not near a surface has those of the
    nearest one that is: deep inside and far outside of an organ a motion decides nothing."""
    shape = tuple(np.ceil((high - low) / step_mm).astype(int) + 1)
    points = low + step_mm * np.moveaxis(np.indices(shape), 0, -1).reshape(-1, 3)
    near = surfaces.query(points, distance_upper_bound=_NEAR_MM)[0] < _NEAR_MM
    asked = np.vstack([motion.at(part) for part in np.array_split(points[near], 1 + near.sum() // _AT_ONCE)])
    values = asked[cKDTree(points[near]).query(points)[1]]
    affine = np.diag([step_mm, step_mm, step_mm, 1.0])
    affine[:3, 3] = low
    return Volume(values.reshape(*shape, 3), affine)
