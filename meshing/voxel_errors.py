"""Errors of the surfaces of the organ and of the walls that come from their labels' voxels, as draws.

The same body on a grid that lies a fraction of a voxel elsewhere gives another label and another surface. Where the surface
is parallel to the slices it is off over a whole cap at once, by up to half of their distance.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.stats import qmc

from palpate.core.arrays import FloatArray
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_near, wall_near
from palpate.meshing.separable import along_axis, linear_weights
from palpate.meshing.smooth_distance import SmoothField, smooth_distance, smooth_field

# Grids that are tried; from 16 to 60 the spread of ln G that follows changed by less than a fifth on two pelves.
DRAWS = 24
# Half step of the differences that give the field's slope, mm.
_STEP_MM = 0.25


def organ_voxel_errors(
    labels: Volume, points: FloatArray, ids: tuple[int, ...] = (1, 2), draws: int = DRAWS
) -> FloatArray:
    """Errors (draws, n) mm along the outward normal at points (n, 3) mm of the organ's surface, their mean taken away.

    The surface found is voxelised again on grids that are shifted evenly over a voxel (a Halton sequence), and each is
    smoothed as the label was. Raises InputError when none of the labels is there.
    """
    near = organ_near(labels, ids)
    return _errors(near.with_array(near.array > 0), points, draws)


def wall_voxel_errors(labels: Volume, label: int, points: FloatArray, draws: int = DRAWS) -> FloatArray:
    """The same (draws, n) mm at points (n, 3) mm of the surface of one label (5 bladder, 6 rectum; see `wall_surface`)."""
    return _errors(wall_near(labels, label), points, draws)


def _errors(near: Volume, points: FloatArray, draws: int) -> FloatArray:
    """near : mask of the body."""
    body = smooth_field(near, near.array, 1.0)
    # Of the label's own field: that of the others differs by a few hundredths, and takes six times as long.
    slope = _slope(near, points)
    shifts = qmc.Halton(3, scramble=False).random(draws) - 0.5
    errors = np.stack([_on_shifted_grid(near, body, shift, points) / slope for shift in shifts])
    return errors - errors.mean(axis=0)


def _on_shifted_grid(grid: Volume, body: SmoothField, shift: FloatArray, points: FloatArray) -> FloatArray:
    """The smoothed distance (n,) mm of the body voxelised on a grid moved by a share (3,) of a voxel."""
    distance = np.asarray(body.grid.array, dtype=np.float64)
    for axis, count in enumerate(grid.array.shape):
        centres = np.zeros((count, 3))
        centres[:, axis] = np.arange(count) + shift[axis]
        places = body.grid.to_index(grid.to_lps(centres))[:, axis]
        distance = along_axis(linear_weights(places, distance.shape[axis]), distance, axis)
    smooth = smooth_distance(distance > 0.0, grid.spacing)
    return _at(ndimage.spline_filter(smooth, order=3), grid.to_index(points) - shift)


def _slope(near: Volume, points: FloatArray) -> FloatArray:
    """Slope (n,) of a mask's own smoothed distance."""
    field = ndimage.spline_filter(smooth_distance(near.array.astype(bool), near.spacing), order=3)
    steps = _STEP_MM * np.eye(3)
    ends = [[_at(field, near.to_index(points + way * step)) for way in (1.0, -1.0)] for step in steps]
    gradient = np.stack([(after - before) / (2.0 * _STEP_MM) for after, before in ends], axis=1)
    return np.maximum(np.linalg.norm(gradient, axis=1), 0.5)


def _at(coefficients: FloatArray, index: FloatArray) -> FloatArray:
    """Cubic spline (n,) at indices (n, 3)."""
    return np.asarray(ndimage.map_coordinates(coefficients, index.T, order=3, mode="nearest", prefilter=False))
