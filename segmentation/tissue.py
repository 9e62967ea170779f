"""The tissue about the organs: which part of the body is modelled, and the label volume of it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.labels import BLADDER, BONE, OUTSIDE, RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume

Mask = NDArray[np.bool_]


def region_of_interest(prostate: Volume, margin_mm: FloatArray) -> FloatArray:
    """The box (2, 3) mm, LPS, around a mask with a margin (3,) mm along each axis."""
    points = prostate.to_lps(np.argwhere(prostate.array).astype(float))
    half = 0.5 * float(prostate.spacing.max())
    return np.array([points.min(axis=0) - half - margin_mm, points.max(axis=0) + half + margin_mm])


def cropped(volume: Volume, box: FloatArray) -> Volume:
    """The voxels of a volume whose centres lie in a box (2, 3) mm, or as few more as its axes allow."""
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    index = volume.to_index(corners)
    low = np.clip(np.ceil(index.min(axis=0) - 1e-6).astype(int), 0, np.array(volume.array.shape) - 1)
    high = np.clip(np.floor(index.max(axis=0) + 1e-6).astype(int) + 1, low + 1, volume.array.shape)
    affine = volume.affine.copy()
    affine[:3, 3] = volume.to_lps(low[None].astype(float))[0]
    return Volume(volume.array[tuple(slice(a, b) for a, b in zip(low, high, strict=True))], affine)


def label_array(prostate: LabelArray, masks: Mapping[str, Mask], body: Mask) -> LabelArray:
    """Labels of docs/case.md of one grid: organs first, then bladder, rectum, bone, and tissue in what is left of the body.

    prostate : labels 1 and 2. masks : "bladder", "rectum", "bone" where known. Tissue that does not hang together with
    the prostate's surroundings is left outside: nothing that drives the organ reaches it; between organs it joins the nearest.
    """
    result = np.where(body, SURROUNDING_TISSUE, OUTSIDE).astype(np.uint8)
    for name, value in (("bone", BONE), ("rectum", RECTUM), ("bladder", BLADDER)):
        if name in masks:
            result[masks[name]] = value
    result[prostate > 0] = prostate[prostate > 0]
    return _without_islands(result, prostate > 0)


def _without_islands(labels: LabelArray, prostate: Mask) -> LabelArray:
    parts, count = ndimage.label(labels == SURROUNDING_TISSUE)
    if count < 2:
        return labels
    beside = np.bincount(parts[ndimage.binary_dilation(prostate, iterations=2)], minlength=count + 1)
    sizes = np.bincount(parts.ravel())
    beside[0] = sizes[0] = 0
    keep = int(beside.argmax() if beside.any() else sizes.argmax())
    island = (parts > 0) & (parts != keep)
    # A few voxels left between prostate and bladder or rectum belong to one of them: the model has no room for a hole there.
    squeezed = island & np.isin(parts, np.unique(parts[ndimage.binary_dilation(prostate)]))
    nearest = ndimage.distance_transform_edt(parts > 0, return_distances=False, return_indices=True)
    labels[island] = OUTSIDE
    labels[squeezed] = labels[tuple(nearest)][squeezed]
    return labels
