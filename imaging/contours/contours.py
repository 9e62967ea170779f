"""Closed planar contours as masks on the grid of a volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage.draw import polygon2mask

from palpate.core.arrays import BoolArray, FloatArray, NumberArray
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume

# A contour further than this from flat, mm, was not drawn on the volume's slices.
FLAT_WITHIN_MM = 0.5
# Planes closer than this, in slices, are one plane; a plane this near a slice is on it.
ON_SLICE = 0.05
# polygon2mask counts a voxel centre on the outline as inside. Outlines drawn through centres would gain half a voxel
# all around; moved by less than any rounding, they gain on one side and lose on the other.
_OFF_CENTRE = (1.3e-6, 0.9e-6)
# Contours that are nowhere further apart than this, mm, are one that was written twice, with other rounding: half of the thinnest wall
# that a person can draw on pixels of 1 mm.
TWICE_WITHIN_MM = 0.5
# Of a loop's pixels, at most this share lies outside a loop that it may repeat.
_OUTSIDE = 0.25
# Contours left out over at most this many usual gaps, and mm, are interpolated.
BRIDGED_GAPS = 3.5
BRIDGED_MM = 15.0


def contours_to_mask(
    contours: Sequence[FloatArray], grid: Volume, name: str, notes: list[str], exclusive: bool = False
) -> BoolArray:
    """The voxels of ``grid`` whose centres lie in the structure, shape of its array.

    contours : each (n, 3) mm in LPS, closed, parallel to the volume's slices. Several on one plane add up, except that one in
    another is a hole, and one in that an island; a key-hole channel closes by itself. One that is there twice counts once.
    exclusive : they are combined by exclusive or instead (CLOSEDPLANAR_XOR of DICOM).
    Between planes that are further apart than slices the signed distances to the outlines are interpolated; the first and last
    reach out by half a gap.

    Raises InputError naming the structure when a contour is not parallel to the slices, two loops of a wall are nearer each
    other than the pixels, all lie outside the volume, or they are interrupted for too long.
    """
    planes = {
        height: _combined(parts, grid.spacing[:2], name, notes, exclusive)
        for height, parts in _masks_by_plane([grid.to_index(c) for c in contours], grid, name).items()
    }
    heights = np.array(sorted(planes))
    count = grid.array.shape[2]
    mask = np.zeros(grid.array.shape, dtype=bool)
    if heights[-1] < -0.5 or heights[0] > count - 0.5:
        raise InputError(f"structure {name} lies outside the CT; give the contours of this scan")
    if heights[0] < -0.5 or heights[-1] > count - 0.5:
        notes.append(f"structure {name} reaches beyond the CT and was cut off there")
    usual = float(np.median(np.diff(heights))) if len(heights) > 1 else 1.0
    _check_interruptions(heights, usual, float(grid.spacing[2]), name, notes)
    outlines = _Outlines(planes, grid.spacing[:2])
    for k in range(count):
        mask[:, :, k] = outlines.section(float(k), usual)
    if not mask.any():
        raise InputError(f"structure {name} holds no voxel of the CT; give the contours of this scan")
    return mask


@dataclass(frozen=True, eq=False)
class _Loop:
    """One contour. points : (n, 2) in pixels. mask : the pixels within it."""

    points: FloatArray
    mask: BoolArray


def _masks_by_plane(contours: Sequence[FloatArray], grid: Volume, name: str) -> dict[float, list[_Loop]]:
    planes: dict[float, list[_Loop]] = {}
    for points in contours:
        height = float(points[:, 2].mean())
        if np.ptp(points[:, 2]) * grid.spacing[2] > FLAT_WITHIN_MM:
            raise InputError(
                f"a contour of structure {name} is not parallel to the CT's slices; export contours drawn on them"
            )
        height = round(height) if abs(height - round(height)) < ON_SLICE else height
        plane = next((known for known in planes if abs(known - height) < ON_SLICE), height)
        flat = points[:, :2]
        planes.setdefault(plane, []).append(_Loop(flat, polygon2mask(grid.array.shape[:2], flat - _OFF_CENTRE)))
    return planes


def _combined(loops: list[_Loop], pixel: FloatArray, name: str, notes: list[str], exclusive: bool) -> BoolArray:
    """One mask of the contours on one plane. pixel : edge lengths (2,) mm."""
    distinct: list[_Loop] = []
    for loop in sorted(loops, key=lambda each: -int(each.mask.sum())):
        if any(_is_twice(loop, other, pixel, name, exclusive) for other in distinct):
            note = f"structure {name} has a contour twice on a slice; it was taken once"
            notes += [note] if note not in notes else []
        else:
            distinct.append(loop)
    masks = [loop.mask for loop in distinct]
    if exclusive:
        return np.logical_xor.reduce(masks)
    # From the largest on: one in an odd number of others is a hole in them.
    depths = [sum(not (part & ~larger).any() for larger in masks[:at]) for at, part in enumerate(masks)]
    mask = np.zeros_like(masks[0])
    for depth, part in sorted(zip(depths, masks, strict=True), key=lambda pair: pair[0]):
        mask = mask & ~part if depth % 2 else mask | part
    return mask


def _is_twice(loop: _Loop, larger: _Loop, pixel: FloatArray, name: str, exclusive: bool) -> bool:
    """Whether two contours are one, up to the rounding of its points. Raises InputError where they are two that pixels cannot part;
    exclusive : the file says that the one is cut out of the other, so that any pixel between them is one of the wall."""
    if not loop.mask.any() or (loop.mask & ~larger.mask).sum() > _OUTSIDE * loop.mask.sum():
        return False
    apart = np.concatenate([_distances(loop, larger, pixel), _distances(larger, loop, pixel)])
    if apart.max() <= TWICE_WITHIN_MM:
        return True
    usual = float(np.median(apart))
    if usual >= pixel.max() or (exclusive and (loop.mask ^ larger.mask).any()):
        return False
    raise InputError(
        f"structure {name} has two contours {usual:.1f} mm apart on a slice, nearer than pixels of {pixel.max():.1f} mm can show: "
        "a wall that is drawn as two loops, or one contour in two versions; keep the outer one"
    )


def _distances(loop: _Loop, other: _Loop, pixel: FloatArray) -> FloatArray:
    """From each corner of a closed contour to the other's line, (n,) mm."""
    points, start = loop.points * pixel, other.points * pixel
    along = np.roll(start, -1, axis=0) - start
    length = np.maximum((along**2).sum(axis=1), 1e-12)
    away = points[:, None] - start
    share = np.clip((away * along).sum(axis=-1) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(away - share[..., None] * along, axis=-1).min(axis=1), dtype=np.float64)


def _check_interruptions(heights: NumberArray, usual: float, slice_mm: float, name: str, notes: list[str]) -> None:
    gaps = np.diff(heights)
    wide = gaps[gaps > 1.5 * usual]
    if len(wide) == 0:
        return
    if wide.max() > BRIDGED_GAPS * usual or wide.max() * slice_mm > BRIDGED_MM:
        raise InputError(
            f"the contours of structure {name} are interrupted for {wide.max() * slice_mm:.0f} mm; "
            f"up to {min(BRIDGED_GAPS * usual * slice_mm, BRIDGED_MM):.0f} mm is interpolated; draw what is missing"
        )
    notes.append(f"the contours of structure {name} are interrupted in {len(wide)} places and were interpolated there")


class _Outlines:
    """The masks of a structure by height, and sections between them."""

    def __init__(self, planes: dict[float, BoolArray], spacing: FloatArray) -> None:
        self.planes, self.spacing = planes, spacing
        self.heights = np.array(sorted(planes))
        self.distances: dict[float, FloatArray] = {}

    def section(self, k: float, usual: float) -> BoolArray | bool:
        """The mask at height k; planes are ``usual`` apart."""
        heights = self.heights
        # The end planes own half a gap beyond them, limit excluded: a slice there would add half a slice of volume.
        if k < heights[0] - 0.5 * usual + 1e-6 or k > heights[-1] + 0.5 * usual - 1e-6:
            return False
        after = int(np.searchsorted(heights, k))
        if after < len(heights) and heights[after] == k:
            return self.planes[heights[after]]
        if after in (0, len(heights)):
            return self.planes[heights[min(after, len(heights) - 1)]]
        low, high = heights[after - 1], heights[after]
        weight = (k - low) / (high - low)
        return (1.0 - weight) * self._distance(low) + weight * self._distance(high) > 0.0

    def _distance(self, height: float) -> FloatArray:
        if height not in self.distances:
            self.distances[height] = _signed_distance(self.planes[height], self.spacing)
        return self.distances[height]


def _signed_distance(inside: BoolArray, spacing: FloatArray) -> FloatArray:
    """Distance to the outline, mm, positive inside. Half a voxel each way: the outline lies between voxel centres."""
    if not inside.any():
        return np.full(inside.shape, -1e6)
    half = 0.5 * float(spacing.min())
    within = ndimage.distance_transform_edt(inside, sampling=spacing) - half
    without = ndimage.distance_transform_edt(~inside, sampling=spacing) - half
    return np.where(inside, within, -without)
