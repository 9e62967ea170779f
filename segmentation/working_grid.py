"""Grids to work on: upright in the patient, evenly spaced, and as large as is needed."""

from __future__ import annotations

import numpy as np
import SimpleITK as sitk
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray
from palpate.imaging.volume import Volume

Mask = NDArray[np.bool_]

# Spacing, mm, for finding organs and for drawing their boundaries.
COARSE_MM = 3.0
FINE_MM = 1.25
# HU outside this are cut off before interpolation, so that gas and metal do not ring.
LOW_HU, HIGH_HU = -400.0, 700.0
AIR_HU = -1000.0
# Half-way from soft tissue to gas as it is cut off at LOW_HU; fat is never as dark.
GAS_HU = -180.0
RIM_MM = 1.6
# What stands in for gas, and for the voxels that gas has darkened, so that an edge is an edge against fat only.
SOFT_HU = 40.0


def upright(low: FloatArray, high: FloatArray, step_mm: float) -> Volume:
    """An empty grid (array of zeros) with axes along LPS whose voxels fill the box from ``low`` to ``high`` (3,) mm."""
    shape = np.maximum(1, np.ceil((np.asarray(high) - low) / step_mm - 1e-9).astype(int))
    affine = np.diag([step_mm, step_mm, step_mm, 1.0])
    affine[:3, 3] = np.asarray(low) + 0.5 * step_mm
    return Volume(np.zeros(shape, dtype=np.uint8), affine)


def bounds(volume: Volume) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest coordinates (3,) mm that a volume's voxels, edges included, reach."""
    n = np.array(volume.array.shape) - 0.5
    corners = np.array([[i, j, k] for i in (-0.5, n[0]) for j in (-0.5, n[1]) for k in (-0.5, n[2])])
    points = volume.to_lps(corners)
    return points.min(axis=0), points.max(axis=0)


def resampled(ct: Volume, grid: Volume, smooth: bool = True) -> Volume:
    """The CT (HU, cut to LOW_HU..HIGH_HU) on a grid, float32. ``smooth``: cubic, else linear."""
    image = sitk.Clamp(sitk.Cast(ct.to_sitk(), sitk.sitkFloat32), sitk.sitkFloat32, LOW_HU, HIGH_HU)
    how = sitk.sitkBSpline3 if smooth else sitk.sitkLinear
    return _sampled(image, grid, how)


def mask_on(mask: Volume, grid: Volume) -> Mask:
    """A mask on another grid, its outline interpolated."""
    image = sitk.Cast(mask.with_array(mask.array.astype(np.uint8)).to_sitk(), sitk.sitkFloat32)
    return _sampled(image, grid, sitk.sitkLinear).array > 0.5


def _sampled(image: sitk.Image, grid: Volume, how: int) -> Volume:
    """An image on another grid. Beyond its last voxels the image goes on as it ends: organs do, too."""
    resample = sitk.ResampleImageFilter()
    resample.SetSize([int(n) for n in grid.array.shape])
    resample.SetOutputOrigin([float(x) for x in grid.affine[:3, 3]])
    resample.SetOutputSpacing([float(s) for s in grid.spacing])
    resample.SetOutputDirection((grid.affine[:3, :3] / grid.spacing).ravel().tolist())
    resample.SetOutputPixelType(sitk.sitkFloat32)
    resample.SetInterpolator(how)
    resample.UseNearestNeighborExtrapolatorOn()
    return Volume.from_sitk(resample.Execute(image))


def shrunk(ct: Volume, step_mm: float) -> Volume:
    """The CT averaged to about ``step_mm``, float32, on an upright grid over its whole extent."""
    factor = [max(1, int(step_mm / s + 1e-6)) for s in ct.spacing]
    image = sitk.BinShrink(sitk.Cast(ct.to_sitk(), sitk.sitkFloat32), factor)
    low, high = bounds(ct)
    return resampled(Volume.from_sitk(image), upright(low, high, step_mm), smooth=False)


def blurred(array: NDArray[np.floating], sigma_mm: float, step_mm: float) -> Float32Array:
    """Gaussian smoothing of an array on an even grid."""
    return np.asarray(ndimage.gaussian_filter(array.astype(np.float32), sigma_mm / step_mm, mode="nearest"))


def gas_filled(array: NDArray[np.floating], step_mm: float) -> tuple[Float32Array, Mask]:
    """HU with gas, and the rim that it darkens, set to soft tissue; and the mask of the gas itself."""
    gas = array < GAS_HU
    rim = dilated(gas, RIM_MM, step_mm) & (array < SOFT_HU)
    return np.where(rim, np.float32(SOFT_HU), array).astype(np.float32), gas


def dilated(mask: Mask, radius_mm: float, step_mm: float) -> Mask:
    """The mask grown by a ball."""
    if not mask.any():
        return mask.copy()
    near, out = box_around(mask, radius_mm / step_mm), np.zeros(mask.shape, dtype=bool)
    out[near] = distance_to(mask[near], step_mm) <= radius_mm
    return out


def eroded(mask: Mask, radius_mm: float, step_mm: float) -> Mask:
    """The mask shrunk by a ball; what lies beyond the grid counts as mask."""
    if mask.all() or not mask.any():
        return mask.copy()
    near, out = box_around(mask, 0.0), np.zeros(mask.shape, dtype=bool)
    out[near] = distance_to(~mask[near], step_mm) > radius_mm
    return out


def distance_to(mask: Mask, step_mm: float) -> FloatArray:
    """Distance, mm, of every voxel's centre from the nearest of a mask on an even grid; infinite where the mask is empty.

    As scipy's distance_transform_edt of what lies beyond the mask, in two thirds of the time.
    """
    if not mask.any():
        return np.full(mask.shape, np.inf)
    image = sitk.GetImageFromArray(mask.astype(np.uint8))
    # Squares, in voxels, are whole numbers and so free of rounding. They are below zero within the mask.
    squares = sitk.SignedMaurerDistanceMap(image, insideIsPositive=False, squaredDistance=True, useImageSpacing=False)
    return step_mm * np.sqrt(np.maximum(sitk.GetArrayFromImage(squares), 0.0, dtype=float))


def depth_of(mask: Mask, step_mm: float) -> float:
    """Largest distance, mm, of a voxel of the mask from what lies beyond; the mask may not be empty."""
    return float(distance_to(~mask[box_around(mask, 0.0)], step_mm).max())


def filled(mask: Mask, within: int | None = None) -> Mask:
    """The mask and the holes that it encloses. within : the axis across which slices are filled one by one; in space where None."""
    link = ndimage.generate_binary_structure(mask.ndim, 1)
    ends = [axis for axis in range(mask.ndim) if axis != within]
    if within is not None:
        np.moveaxis(link, within, 0)[[0, 2]] = False
    parts, count = ndimage.label(~mask, link)
    hole = np.ones(count + 1, dtype=bool)
    for axis in ends:
        hole[np.take(parts, (0, -1), axis=axis)] = False
    hole[0] = True  # the mask itself
    return np.asarray(hole[parts])


def box_around(mask: Mask, margin: float) -> tuple[slice, ...]:
    """The part of a grid that holds a mask that is not empty, and one voxel more than a margin (in voxels) about it."""
    room = int(np.ceil(margin)) + 1
    slices = []
    for axis in range(mask.ndim):
        used = np.flatnonzero(mask.any(axis=tuple(a for a in range(mask.ndim) if a != axis)))
        slices.append(slice(max(0, int(used[0]) - room), int(used[-1]) + room + 1))
    return tuple(slices)


def opened(mask: Mask, radius_mm: float, step_mm: float) -> Mask:
    """The mask without what a ball cannot enter."""
    return dilated(eroded(mask, radius_mm, step_mm), radius_mm, step_mm) & mask


def signed_distance(mask: Mask, grid: Volume) -> Volume:
    """Distance, mm, from the outline of a mask on an even grid, negative inside; infinite without an outline."""
    step = float(grid.spacing[0])
    if not mask.any() or mask.all():
        return grid.with_array(np.full(mask.shape, -np.inf if mask.any() else np.inf, dtype=np.float32))
    outside, inside = distance_to(mask, step), np.zeros(mask.shape)
    near = box_around(mask, 0.0)
    inside[near] = distance_to(~mask[near], step)
    # Voxel centres lie half a voxel from the outline between them.
    return grid.with_array((outside - inside - 0.5 * step * np.sign(outside - inside)).astype(np.float32))


def distance_of(points: FloatArray, mask: Mask, grid: Volume) -> FloatArray:
    """Signed distance (n,), mm, of points (n, 3) mm from the outline of a mask: computed in the box that holds both."""
    used, last = mask.copy(), np.array(mask.shape) - 1
    used[tuple(np.clip(np.rint(grid.to_index(points)), 0, last).astype(int).T)] = True
    if not used.any():
        return np.zeros(0)
    near = box_around(used, 0.0)
    affine = grid.affine.copy()
    affine[:3, 3] = grid.to_lps(np.array([[part.start for part in near]], dtype=float))[0]
    return signed_distance(mask[near], Volume(mask[near], affine)).at(points)


def largest(mask: Mask) -> Mask:
    """The largest connected part (6 neighbours)."""
    parts, count = ndimage.label(mask)
    if count < 2:
        return mask
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    return np.asarray(parts == sizes.argmax())
