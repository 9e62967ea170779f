"""Coordinate frame of labels drawn on the deformed scan: the scanner's own, or the rest frame.

`palpate export` writes the deformed scan in the rest frame for ITK-SNAP and 3D Slicer. A NIfTI or NRRD label file does
not name its frame. The frame follows from the voxel grid: labels lie on the grid of the scan that they were drawn on, or
were resampled along its axes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.contours.label_reader import UserLabels
from palpate.imaging.contours.readers import readers
from palpate.imaging.grid import in_lps_order
from palpate.imaging.volume import Volume

# Tolerances under which two grids count as one: voxel axes in mm, voxel centres as a share of a voxel. And under which two
# directions do: ten times what a NIfTI header rounds.
_STEP_MM, _SHARE, _TURNED = 1e-3, 0.02, 1e-5
NOTE = "they were drawn on the scan as it was exported, moved onto the one at rest, and were taken from there"
UNSURE = (
    "their voxels are neither the scan's nor those of the exported scan; they were taken to be drawn on the scan as the scanner "
    "wrote it: look at them in the window"
)


def lies_on(labels: Volume, grid: Volume) -> bool:
    """Whether the voxel centres of `labels` are voxel centres of `grid`, extended beyond its ends."""
    one, other = in_lps_order(labels), in_lps_order(grid)
    if np.abs(one.affine[:3, :3] - other.affine[:3, :3]).max() > _STEP_MM:
        return False
    ends = np.array([[0.0, 0.0, 0.0], np.array(one.array.shape) - 1.0])
    index = other.to_index(one.to_lps(ends))
    return bool(np.abs(index - np.rint(index)).max() < _SHARE)


def in_own_frame(
    labels: UserLabels, ct: Volume, deformed_to_rest: FloatArray, aligned: Volume | None = None
) -> UserLabels:
    """Labels of the deformed scan in the scanner's own coordinates (LPS, mm); labels in the rest frame are moved there.

    ct : the deformed scan in the scanner's coordinates. deformed_to_rest : (4, 4) rigid transform, mm. aligned : a
    further grid in the rest frame, such as the case's label volume. Labels that were moved carry `NOTE` in their notes,
    labels whose frame nothing tells `UNSURE`.
    """
    frame_is_named = not readers()[labels.source].holds_voxels
    if frame_is_named or np.allclose(deformed_to_rest, np.eye(4)) or lies_on(labels.volume, ct):
        return labels
    moved = ct.moved(deformed_to_rest)
    grids = [moved, *([] if aligned is None else [aligned])]
    if not any(lies_on(labels.volume, grid) for grid in grids):
        along, along_moved = (_turned(labels.volume, grid) < _TURNED for grid in (ct, moved))
        if along or not along_moved:
            sure = along and not along_moved
            return labels if sure else replace(labels, notes=(*labels.notes, UNSURE))
    own = labels.volume.moved(np.linalg.inv(deformed_to_rest).astype(np.float64))
    return replace(labels, volume=own, notes=(*labels.notes, NOTE))


def _turned(one: Volume, other: Volume) -> float:
    """How far the axes of two grids are turned against each other: the largest difference of their directions."""
    first, second = (
        v.affine[:3, :3] / np.linalg.norm(v.affine[:3, :3], axis=0) for v in map(in_lps_order, (one, other))
    )
    return float(np.abs(first - second).max())
