"""Editing of a whole label at once: fill between slices, smooth, keep the largest piece, grow, shrink.

A label that grows takes only from tissue and from what lies outside, never from another organ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.imaging.labels import OUTSIDE, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.labels.strokes import Stroke, erased_to

# Voxels kept beside the label's own box: a label that grows or is smoothed needs room.
_MARGIN = 2
_SMOOTH_MM = 2.0

# Inside (i, j, k) of a label, voxel edges (3,) mm, amount in mm -> inside after.
Operation = Callable[[BoolArray, FloatArray, float], BoolArray]


def fill_between_slices(inside: BoolArray, spacing: FloatArray, amount_mm: float) -> BoolArray:
    """Draws the axial slices between drawn ones, by shape-based interpolation.

    Linear in the signed distance to the outlines of the slices on both sides (Raya and Udupa, IEEE TMI 9:32, 1990).
    """
    out = inside.copy()
    drawn = np.flatnonzero(inside.any(axis=(0, 1)))
    for low, high in pairwise(drawn):
        if high - low > 1:
            below, above = (_signed_distance(inside[:, :, k], spacing[:2]) for k in (low, high))
            for k in range(low + 1, high):
                share = (k - low) / (high - low)
                out[:, :, k] = (1.0 - share) * below + share * above < 0.0
    return out


def smooth(inside: BoolArray, spacing: FloatArray, amount_mm: float) -> BoolArray:
    """Takes steps and spikes away, and keeps the volume.

    The shape is blurred by a Gaussian of standard deviation amount_mm (mm; 2 where it is 0) and cut where as many voxels lie
    inside as before: cut at one half, a ball of radius 9 mm would lose 13 % of its volume.
    """
    blurred = ndimage.gaussian_filter(inside.astype(np.float64), (amount_mm or _SMOOTH_MM) / spacing, mode="constant")
    level = np.partition(blurred, -int(inside.sum()), axis=None)[-int(inside.sum())]
    return np.asarray(blurred >= level)


def largest_island(inside: BoolArray, spacing: FloatArray, amount_mm: float) -> BoolArray:
    """The largest connected piece alone."""
    pieces, count = ndimage.label(inside)
    if count < 2:
        return inside
    return np.asarray(pieces == 1 + np.argmax(np.bincount(pieces.ravel())[1:]))


def grow(inside: BoolArray, spacing: FloatArray, amount_mm: float) -> BoolArray:
    """Adds what lies within amount_mm (mm) of the label."""
    return np.asarray(ndimage.distance_transform_edt(~inside, sampling=spacing) <= amount_mm)


def shrink(inside: BoolArray, spacing: FloatArray, amount_mm: float) -> BoolArray:
    """Takes away what lies within amount_mm (mm) of the label's outside."""
    return np.asarray(ndimage.distance_transform_edt(inside, sampling=spacing) > amount_mm)


OPERATIONS: Mapping[str, Operation] = {
    "fill between slices": fill_between_slices,
    "smooth": smooth,
    "keep the largest piece": largest_island,
    "grow": grow,
    "shrink": shrink,
}


def changed_label(volume: Volume, state: str, label: int, operation: str, amount_mm: float) -> Stroke | None:
    """What an operation changes of a label, as one stroke; nothing is changed yet. None where nothing would change."""
    inside = np.asarray(volume.array == label)
    if not inside.any():
        return None
    margin = np.ceil(amount_mm / volume.spacing).astype(int) + _MARGIN
    ends = np.argwhere(inside)
    low = np.maximum(ends.min(axis=0) - margin, 0)
    box = tuple(slice(a, b) for a, b in zip(low, ends.max(axis=0) + margin + 1, strict=True))
    part, within = volume.array[box], inside[box]
    after = OPERATIONS[operation](within, volume.spacing, amount_mm)
    gained = after & ~within & np.isin(part, (OUTSIDE, SURROUNDING_TISSUE))
    lost = within & ~after
    places = np.argwhere(gained | lost)
    if not len(places):
        return None
    new = np.where(gained[tuple(places.T)], label, erased_to(label)).astype(np.uint8)
    index = np.ravel_multi_index(tuple((places + low).T), volume.array.shape)
    return Stroke(state, index, part[tuple(places.T)].astype(np.uint8), new)


def values_at(scan: Volume, labels: Volume, index: IntArray) -> FloatArray:
    """HU (n,) of the scan at the centres of labelled voxels, flat indices (n,); not a number where the scan does not reach."""
    points = labels.to_lps(np.stack(np.unravel_index(index, labels.array.shape), axis=1).astype(np.float64))
    return scan.nearest(points, np.nan)


def _signed_distance(inside: BoolArray, spacing: FloatArray) -> FloatArray:
    """Distance (i, j) mm to the outline, negative inside."""
    outer = ndimage.distance_transform_edt(~inside, sampling=spacing)
    return np.asarray(outer - ndimage.distance_transform_edt(inside, sampling=spacing), dtype=np.float64)
