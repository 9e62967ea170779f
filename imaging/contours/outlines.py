"""Label masks as closed planar contours on a CT's slices: the way back from contours.py."""

from __future__ import annotations

import numpy as np
from skimage.measure import find_contours

from palpate.core.arrays import BoolArray, FloatArray
from palpate.imaging.grid import labels_resampled
from palpate.imaging.volume import Volume

# Contours are drawn at most this much finer than the CT's pixels, an odd number.
FINEST = 3
# A part smaller than this many corners is no area.
_FEWEST_POINTS = 3


def labels_on_slices(labels: Volume, ct: Volume) -> tuple[Volume, int]:
    """The labels sampled on the slices of a CT, as finely within them as they are, and the first slice's index.

    In-plane grids are the CT's or an odd fraction of it, so that each pixel's centre is the centre of a finer pixel:
    contours read back on the CT's pixels give what `labels_resampled` gives there. Cropped to the slices and pixels that
    hold labels.
    """
    finer = np.ceil(ct.spacing / labels.spacing.min() - 0.05).clip(1, FINEST).astype(int)
    finer += 1 - finer % 2
    factor = np.array([finer[0], finer[1], 1])
    index = ct.to_index(labels.to_lps(np.argwhere(labels.array > 0).astype(float)))
    low = np.maximum(np.floor(index.min(axis=0)) - 1, 0).astype(int)
    high = np.minimum(np.ceil(index.max(axis=0)) + 2, ct.array.shape).astype(int)
    affine = ct.affine.copy()
    affine[:3, :3] = ct.affine[:3, :3] / factor
    # The first fine voxel lies so that the fine ones fill the coarse one.
    affine[:3, 3] = ct.to_lps((low + 0.5 / factor - 0.5)[None])[0]
    empty = Volume(np.zeros(np.maximum(high - low, 1) * factor, dtype=np.uint8), affine)
    return labels_resampled(labels, empty), int(low[2])


def outlines(mask: BoolArray) -> list[FloatArray]:
    """Closed contours (n, 2) around the parts of a mask (ni, nj), and around its holes, in index coordinates.

    They run half way between voxel centres, so that just the centres of the mask lie within an odd number of them.
    """
    padded = np.pad(mask, 1).astype(np.float64)
    found = [_corners(contour[:-1] - 1.0) for contour in find_contours(padded, 0.5)]
    return [contour for contour in found if len(contour) >= _FEWEST_POINTS]


def _corners(points: FloatArray) -> FloatArray:
    """The points at which a closed contour turns."""
    after, before = np.roll(points, -1, axis=0) - points, points - np.roll(points, 1, axis=0)
    turns = np.abs(after[:, 0] * before[:, 1] - after[:, 1] * before[:, 0]) > 1e-9
    return np.asarray(points[turns])
