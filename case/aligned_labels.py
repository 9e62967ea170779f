"""Labels of the deformed scan that were drawn on it as `export` writes it for ITK-SNAP and 3D Slicer: moved onto the scan at rest.

A NIfTI or NRRD file does not say on which of the two it was drawn; its voxels do, where they are those of the scan.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.contours.user_labels import UserLabels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.volume import Volume

# Two grids are one where their steps differ by less than this, mm, and their voxels by less than this share of a voxel.
_STEP_MM, _SHARE = 1e-3, 0.02
NOTE = "they were drawn on the scan as it was exported, moved onto the one at rest, and were taken from there"


def lies_on(labels: Volume, grid: Volume) -> bool:
    """Whether voxels of one volume are voxels of the other's grid, or of its continuation."""
    one, other = in_lps_order(labels), in_lps_order(grid)
    if np.abs(one.affine[:3, :3] - other.affine[:3, :3]).max() > _STEP_MM:
        return False
    ends = np.array([[0.0, 0.0, 0.0], np.array(one.array.shape) - 1.0])
    index = other.to_index(one.to_lps(ends))
    return bool(np.abs(index - np.rint(index)).max() < _SHARE)


def in_own_frame(
    labels: UserLabels, ct: Volume, deformed_to_rest: FloatArray, aligned: Volume | None = None
) -> UserLabels:
    """Labels of the deformed scan in its scanner's own coordinates, wherever they were drawn; a note says when they were moved.

    ct : as it was scanned. deformed_to_rest : (4, 4), what aligned it. aligned : another grid of the rest frame that labels may have
    been exported on, the case's own.
    """
    if labels.source not in ("nifti", "itksnap", "seg.nrrd") or lies_on(labels.volume, ct):
        return labels
    grids = [ct.moved(deformed_to_rest), *([] if aligned is None else [aligned])]
    if not any(lies_on(labels.volume, grid) for grid in grids):
        return labels
    own = labels.volume.moved(np.linalg.inv(deformed_to_rest).astype(np.float64))
    return replace(labels, volume=own, notes=(*labels.notes, NOTE))
