"""Labels made ready for surfaces: carried on beyond the modelled box, cropped, freed of specks."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray
from palpate.imaging.volume import Volume


def extend_labels(labels: Volume, outside: int = 0) -> Volume:
    """Give every outside voxel the label of the nearest labelled voxel, on the same grid.

    A label volume ends at the box that is modelled. Tubes and bones run on in the patient, so a surface
    of them must run through the faces of the box; without this it would be closed by a flat cap there.

    labels : label volume with at least one voxel that is not ``outside``; returned unchanged otherwise.
    """
    empty = labels.array == outside
    if empty.all() or not empty.any():
        return labels
    nearest = ndimage.distance_transform_edt(
        empty, sampling=labels.spacing, return_distances=False, return_indices=True
    )
    return labels.with_array(labels.array[tuple(nearest)])


def crop(labels: Volume, mask: BoolArray, margin_mm: float) -> Volume:
    """The part of a volume within ``margin_mm`` of the bounding box of a mask (ni, nj, nk), as far as the grid goes."""
    margin = np.ceil(margin_mm / labels.spacing).astype(int)
    slices = []
    for axis, (pad, size) in enumerate(zip(margin, mask.shape, strict=True)):
        used = np.flatnonzero(mask.any(axis=tuple(a for a in range(3) if a != axis)))
        slices.append(slice(max(0, int(used[0]) - pad), min(size, int(used[-1]) + pad + 1)))
    affine = labels.affine.copy()
    affine[:3, 3] = labels.to_lps(np.array([[s.start for s in slices]], dtype=float))[0]
    return Volume(labels.array[tuple(slices)], affine)


def padded(labels: Volume, voxels: int, value: int) -> Volume:
    """The volume with ``voxels`` more voxels of one value on every side."""
    affine = labels.affine.copy()
    affine[:3, 3] = labels.to_lps(np.full((1, 3), -float(voxels)))[0]
    return Volume(np.pad(labels.array, voxels, constant_values=value), affine)


def without_specks(mask: BoolArray, share: float = 0.02) -> BoolArray:
    """The mask (ni, nj, nk) without the connected parts (26 neighbours) smaller than ``share`` of the largest part."""
    parts, count = ndimage.label(mask, structure=np.ones((3, 3, 3)))
    if count < 2:
        return mask
    sizes = np.bincount(parts.ravel())
    sizes[0] = 0
    return (sizes >= share * sizes.max())[parts]
