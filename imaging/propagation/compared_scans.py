"""Two scans as contour propagation compares them: the part about the organs, and what of it has a counterpart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.errors import InputError
from palpate.imaging.grid import cropped, labels_on
from palpate.imaging.matching.masks import BONE_HU, GAS_HU
from palpate.imaging.matching.scan_pair import Motion
from palpate.imaging.matching.two_scans import inverse_of
from palpate.imaging.volume import Volume

# Organs that change what they hold.
HOLLOW = ("bladder", "rectum")
# Range of HU in which tissue is told apart; margin about the organs, how much farther the other scan is read, and rims
# about gas and bone, mm.
_HU, _MARGIN_MM, _FARTHER_MM, _GAS_RIM_MM, _BONE_RIM_MM = (-300.0, 400.0), 20.0, 15.0, 1.5, 2.0


@dataclass(frozen=True, eq=False)
class DrawnScan:
    """ct : HU. organs : masks of prostate, bladder and rectum, where known, on any grid, by name."""

    ct: Volume
    organs: Mapping[str, Volume]


@dataclass(frozen=True, eq=False)
class ComparedScans:
    """first, second : HU about the organs of the drawn scan, and of the other. usable : masks of both."""

    first: Volume
    second: Volume
    usable: tuple[BoolArray, BoolArray]

    @classmethod
    def of(cls, drawn: DrawnScan, other: Volume, wall_mm: float) -> ComparedScans:
        """Both scans must lie in one frame. Raises InputError where they do not overlap about the organs."""
        low, high = bounds_of(drawn.organs.values())
        first = cropped(drawn.ct, low - _MARGIN_MM, high + _MARGIN_MM)
        second = cropped(other, low - _MARGIN_MM - _FARTHER_MM, high + _MARGIN_MM + _FARTHER_MM)
        masks = {
            name: labels_on(organ.with_array(organ.array.astype(np.uint8)), first).array > 0
            for name, organ in drawn.organs.items()
        }
        contents = _contents([masks[name] for name in HOLLOW if name in masks], first, wall_mm)
        # Within the prostate dense voxels are calcifications and markers.
        bone = (first.array > BONE_HU) & ~masks.get("prostate", np.zeros(first.array.shape, dtype=bool))
        usable = ~contents & _away(first, first.array < GAS_HU, 0.0) & _away(first, bone, _BONE_RIM_MM)
        there = _away(second, second.array < GAS_HU, _GAS_RIM_MM) & _away(second, second.array > BONE_HU, _BONE_RIM_MM)
        return cls(_clipped(first), _clipped(second), (usable, there))

    def without_contents(self, organs: Mapping[str, Volume], motion: Motion, wall_mm: float) -> ComparedScans:
        """Leaves out, in the other scan too, what hollow organs hold: where the motion takes them."""
        hollow = [organs[name] for name in HOLLOW if name in organs]
        contents = _contents([moved_mask(organ, motion, self.second) for organ in hollow], self.second, wall_mm)
        return ComparedScans(self.first, self.second, (self.usable[0], self.usable[1] & ~contents))


def moved_mask(mask: Volume, motion: Motion, grid: Volume) -> BoolArray:
    """Which voxels of a grid a mask covers after a motion (displacement (n, 3) mm at points (n, 3) mm)."""
    out = np.zeros(grid.array.shape, dtype=bool)
    low, high = bounds_of([mask])
    reach = _MARGIN_MM
    index = np.argwhere(np.ones(grid.array.shape, dtype=bool))
    places = grid.to_lps(index.astype(float))
    near = ((places > low - reach) & (places < high + reach)).all(axis=1)
    back = places[near] + inverse_of(motion, places[near])
    out[tuple(index[near].T)] = mask.with_array(mask.array.astype(np.float32)).at(back) > 0.5
    return out


def bounds_of(masks: Iterable[Volume]) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest coordinates (3,) mm of masks. Raises InputError where all are empty."""
    places = [mask.to_lps(np.argwhere(mask.array).astype(float)) for mask in masks if mask.array.any()]
    if not places:
        raise InputError("there is no contour to carry over to the other scan")
    together = np.vstack(places)
    return together.min(axis=0), together.max(axis=0)


def _contents(masks: Iterable[BoolArray], grid: Volume, wall_mm: float) -> BoolArray:
    out = np.zeros(grid.array.shape, dtype=bool)
    for mask in masks:
        if mask.any():
            out |= ndimage.distance_transform_edt(mask, sampling=grid.spacing) > wall_mm
    return out


def _away(grid: Volume, mask: BoolArray, rim_mm: float) -> BoolArray:
    """Voxels farther than a rim from a mask."""
    if not mask.any():
        return np.ones(mask.shape, dtype=bool)
    return np.asarray(ndimage.distance_transform_edt(~mask, sampling=grid.spacing) > rim_mm)


def _clipped(ct: Volume) -> Volume:
    return ct.with_array(np.clip(ct.array, *_HU).astype(np.float32))
