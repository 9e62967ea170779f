"""Stored values that stand for no picture: outside a scanner's round field of view."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, NumberArray
from palpate.imaging.dicom.slices import Slice

AIR_HU = -1000
# Values up to here are air as they stand.
_LOOKS_LIKE_AIR_HU = -900.0
# Denser than cortical bone.
_METAL_HU = 2000.0
# Above this nothing is: metal saturates at 3071 HU, 30,710 HU on an extended scale, or the largest number that is stored.
HIGHEST_HU = 31_000.0
# A round field of view fills the picture, nearly, and has no such pixels but at its rim: radius as a share of the picture's side,
# the rim's width in pixels, share of a disc of tissue that may happen to have the value and to be joined to the outside; and
# the share of air beside and within the patient.
_LEAST_RADIUS, _RIM, _MOST_WITHIN, _LEAST_AIR = 0.35, 2.0, 0.01, 0.002


def padded(stored: NumberArray, of: Slice) -> BoolArray | None:
    """The pixels (rows, columns) outside the field of view that would be taken for something else than air; None without any.

    Those are pixels of the stated padding value, and of any value that no tissue or metal has, as far as they lie at the edge of the
    picture: elsewhere the first is tissue and the second metal that saturates.
    Signs are not looked at: scanners state a negative value as unsigned.
    """
    mask = _stated(stored, of)
    if mask is None:
        mask = _unstated(stored, of)
    if of.is_hu and stored.size and of.slope > 0.0 and float(stored.max()) * of.slope + of.intercept > HIGHEST_HU:
        impossible = _at_the_edge(stored.astype(np.float64) * of.slope + of.intercept > HIGHEST_HU)
        mask = impossible if mask is None else mask | impossible
    return mask if mask is not None and mask.any() else None


def padding_note(slices: int) -> str:
    """What is told of it."""
    return f"pixels that are no picture (padding outside the field of view) were taken as air, on {slices} slices"


def fill_around_discs(pictures: NumberArray) -> int:
    """Makes air, in place, of what a round field of view leaves of pictures (n, rows, columns), HU; returns on how many.

    Cone-beam scanners write one value there, 0 HU, and say nothing. Without air within, it is air itself, of a wrong slope or
    intercept: that is told of elsewhere.
    """
    masks = {k: mask for k, picture in enumerate(pictures) if (mask := _around_a_disc(picture)) is not None}
    if (
        not masks
        or np.mean([(pictures[k][~mask] <= _LOOKS_LIKE_AIR_HU).mean() for k, mask in masks.items()]) < _LEAST_AIR
    ):
        return 0
    for k, mask in masks.items():
        pictures[k][mask] = AIR_HU
    return len(masks)


def _around_a_disc(picture: NumberArray) -> BoolArray | None:
    """The pixels of the value that all four corners have, where it is none of air and they surround a disc."""
    if picture.size == 0:
        return None
    corners = picture[[0, 0, -1, -1], [0, -1, 0, -1]]
    if np.ptp(corners) > 0.0 or corners[0] <= _LOOKS_LIKE_AIR_HU:
        return None
    mask = _at_the_edge(picture == corners[0])
    return mask if not mask.all() and _is_around_a_disc(mask) else None


def _unstated(stored: NumberArray, of: Slice) -> BoolArray | None:
    """Pixels at the edge of the value that all four corners have, where that is one of metal: nobody's corners are."""
    if not of.is_hu or stored.size == 0:
        return None
    corners = stored[[0, 0, -1, -1], [0, -1, 0, -1]].astype(np.float64) * of.slope + of.intercept
    if np.ptp(corners) > 0.0 or corners[0] < _METAL_HU:
        return None
    return _at_the_edge(stored == stored[0, 0])


def _is_around_a_disc(mask: BoolArray) -> bool:
    """Whether a mask is what a round field of view leaves of the picture."""
    rows, columns = (np.arange(count) - (count - 1) / 2 for count in mask.shape)
    away = np.hypot(rows[:, np.newaxis], columns)
    radius = float(away[~mask].max(initial=0.0))
    within = mask[away < radius - _RIM]
    return radius >= _LEAST_RADIUS * min(mask.shape) and within.mean() < _MOST_WITHIN


def _stated(stored: NumberArray, of: Slice) -> BoolArray | None:
    if of.padding is None or stored.dtype.kind not in "iu":
        return None
    low, high = of.padding
    mask = np.zeros(stored.shape, dtype=bool)
    # The same bits may be read with a sign or without.
    for shift in (0, -(1 << 8 * stored.dtype.itemsize), 1 << 8 * stored.dtype.itemsize):
        mask |= (stored >= low + shift) & (stored <= high + shift)
    if not mask.any():
        return None
    shown = stored[mask].astype(np.float64) * of.slope + of.intercept
    if shown.max() <= _LOOKS_LIKE_AIR_HU:
        return None
    return _at_the_edge(mask)


def _at_the_edge(mask: BoolArray) -> BoolArray:
    """The parts of a mask that touch the edge of the picture."""
    parts, _ = ndimage.label(mask)
    edge = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
    return np.isin(parts, edge[edge > 0])
