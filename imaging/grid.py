"""Grids of volumes: order of axes, and the same values on another grid."""

from __future__ import annotations

import numpy as np
import SimpleITK as sitk
from scipy.optimize import linear_sum_assignment

from palpate.imaging.volume import Volume


def in_lps_order(volume: Volume) -> Volume:
    """The same voxels with axes swapped and flipped so that i, j, k run most nearly to left, posterior, superior.

    Nothing is resampled and every voxel stays where it is in the patient. The grid is right-handed afterwards, so that
    faces wound in index space keep their sense in the patient.
    """
    directions = volume.affine[:3, :3] / volume.spacing
    _, order = linear_sum_assignment(-np.abs(directions))
    array, affine = np.transpose(volume.array, order), volume.affine.copy()
    affine[:3, :3] = volume.affine[:3, order]
    for axis in range(3):
        if affine[axis, axis] < 0:
            affine[:3, 3] += affine[:3, axis] * (array.shape[axis] - 1)
            affine[:3, axis] *= -1
            array = np.flip(array, axis)
    return Volume(np.ascontiguousarray(array), affine)


def labels_on(labels: Volume, grid: Volume) -> Volume:
    """Labels on another grid: of each of its voxels the value that its centre lies in, 0 outside."""
    image = sitk.Resample(labels.to_sitk(), grid.to_sitk(), sitk.Transform(), sitk.sitkNearestNeighbor, 0.0)
    return Volume.from_sitk(image)
