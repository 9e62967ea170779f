"""Grids of volumes: order of axes, and the same values on another grid."""

from __future__ import annotations

import numpy as np
import SimpleITK as sitk
from scipy.optimize import linear_sum_assignment

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume

# Rounding of a label's share at a voxel: files keep positions to about 1e-4 of a voxel.
_ROUNDING = 1e-3


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


def cropped(ct: Volume, low: FloatArray, high: FloatArray) -> Volume:
    """The part of a scan in a box of patient coordinates (3,) mm, axes along LPS.

    Raises InputError where fewer than four voxels along an axis lie in the box.
    """
    ct = in_lps_order(ct)
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T
    index = ct.to_index(corners)
    start = np.maximum(np.floor(index.min(axis=0)).astype(int), 0)
    stop = np.minimum(np.ceil(index.max(axis=0)).astype(int) + 1, ct.array.shape)
    if (stop - start < 4).any():
        raise InputError("the two scans do not overlap about the prostate; align them first")
    affine = ct.affine.copy()
    affine[:3, 3] = ct.to_lps(start[None].astype(float))[0]
    return Volume(np.ascontiguousarray(ct.array[tuple(slice(a, b) for a, b in zip(start, stop, strict=True))]), affine)


def labels_on(labels: Volume, grid: Volume) -> Volume:
    """Labels on another grid: of each of its voxels the value that its centre lies in, 0 outside."""
    image = sitk.Resample(labels.to_sitk(), grid.to_sitk(), sitk.Transform(), sitk.sitkNearestNeighbor, 0.0)
    return Volume.from_sitk(image)


def differing(labels: Volume, given: Volume) -> BoolArray:
    """Voxels of `given` whose label `labels_resampled` would not have put there. Equal shares count as no difference, since
    the last digit of a position decides between them.
    """
    best, own = (np.zeros(given.array.shape, dtype=np.float32) for _ in range(2))
    for value in np.unique([*np.unique(labels.array), *np.unique(given.array)]):
        mask = sitk.Cast(labels.with_array((labels.array == value).astype(np.uint8)).to_sitk(), sitk.sitkFloat32)
        share = Volume.from_sitk(sitk.Resample(mask, given.to_sitk(), sitk.Transform(), sitk.sitkLinear, 0.0)).array
        best, own = np.maximum(best, share), np.where(given.array == value, share, own)
    # Beyond the labels' grid no label has a share: outside is what is found there.
    own = np.where((best == 0.0) & (given.array != 0), -1.0, own)
    return np.asarray(own < best - _ROUNDING)


def labels_resampled(labels: Volume, grid: Volume) -> Volume:
    """Labels (uint8) on another grid: of each of its voxels the label with the largest share at its centre.

    Shares are linear interpolations of each label's mask, so that the staircase of a coarser grid is not copied onto a
    finer one. Voxels whose centres lie beyond the labels' grid are 0. On the same grid nothing changes.
    """
    out = np.zeros(grid.array.shape, dtype=np.uint8)
    box = _index_box(labels, grid)
    if box is None:
        return grid.with_array(out)
    affine = grid.affine.copy()
    affine[:3, 3] = grid.to_lps(np.array([[float(s.start) for s in box]]))[0]
    part = Volume(out[box], affine).to_sitk()
    best = np.full(out[box].shape, 0.0, dtype=np.float32)
    for value in np.unique(labels.array):
        mask = sitk.Cast(labels.with_array((labels.array == value).astype(np.uint8)).to_sitk(), sitk.sitkFloat32)
        share = Volume.from_sitk(sitk.Resample(mask, part, sitk.Transform(), sitk.sitkLinear, 0.0)).array
        wins = share > best
        out[box][wins], best[wins] = value, share[wins]
    return grid.with_array(out)


def _index_box(labels: Volume, grid: Volume) -> tuple[slice, slice, slice] | None:
    """The voxels of a grid among which all labelled ones lie; None where there are none."""
    labelled = np.argwhere(labels.array)
    if not len(labelled):
        return None
    low, high = labelled.min(axis=0) - 1.0, labelled.max(axis=0) + 1.0
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    index = grid.to_index(labels.to_lps(corners))
    first = np.clip(np.floor(index.min(axis=0)), 0, grid.array.shape).astype(int)
    last = np.clip(np.ceil(index.max(axis=0)) + 1, 0, grid.array.shape).astype(int)
    if (last <= first).any():
        return None
    return slice(first[0], last[0]), slice(first[1], last[1]), slice(first[2], last[2])
