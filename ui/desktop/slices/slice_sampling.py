"""One slice of a volume, fast: a view of the array where the grid lies along the patient's axes, else only that slice is sampled."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray
from palpate.imaging.volume import Volume
from palpate.ui.pictures.planes import Plane

# A grid counts as lying along the patient's axes when no voxel is farther from where it would then be than this part of its edge.
_ALIGNED_VOXELS = 0.25
# Larger oblique slices take the nearest voxel: they are looked at from afar, and scrolling must not lag.
_MOST_INTERPOLATED = 60_000
# Of a box whose corners are numbered as `_corners` gives them: those that differ in one index.
_EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]


@dataclass(frozen=True, eq=False)
class SampledSlice:
    """values (rows, columns), first row at the top of the screen. extent : patient coordinates, mm, at the left, right,
    bottom and top edge, as in `planes.Slice`."""

    values: NDArray[np.generic]
    extent: tuple[float, float, float, float]

    @property
    def step(self) -> tuple[float, float]:
        """Pixel edges along columns and rows, mm."""
        left, right, bottom, top = self.extent
        rows, columns = self.values.shape
        return abs(right - left) / columns, abs(top - bottom) / rows


def is_aligned(volume: Volume) -> bool:
    """Whether index axes i, j, k run along +x, +y, +z closely enough to show the voxels themselves."""
    linear = volume.affine[:3, :3]
    off = linear - np.diag(np.diag(linear))
    reach = np.abs(off) @ np.array(volume.array.shape)
    return bool((np.diag(linear) > 0).all() and (reach < _ALIGNED_VOXELS * volume.spacing).all())


def cut(
    volume: Volume,
    plane: Plane,
    position: float,
    fill: float = 0.0,
    nearest: bool = False,
    region: tuple[float, float, float, float] | None = None,
) -> SampledSlice | None:
    """The slice at a patient coordinate (mm) along the plane's normal; None where the volume does not reach.

    volume : axes in LPS order. fill : value outside an oblique volume. nearest : labels, which must not be mixed. region : what of
    an oblique slice is wanted, as lowest and highest coordinate across and then down; the whole slice where None.
    """
    if is_aligned(volume):
        return _own_voxels(volume, plane, position)
    return _sampled(volume, plane, position, fill, nearest, region)


def positions(volume: Volume, plane: Plane) -> tuple[float, float, float]:
    """First and last slice centre along the plane's normal and the distance between slices, mm."""
    corners = _corners(volume)[:, plane.normal]
    step = float(volume.spacing[plane.normal])
    return float(corners.min()) + step / 2.0, float(corners.max()) - step / 2.0, step


def numbered(volume: Volume, plane: Plane, position: float) -> tuple[int, int] | None:
    """Which slice, counted from 1 along the patient's axis, of how many; None where the volume does not reach."""
    first, last, step = positions(volume, plane)
    count, number = round((last - first) / step) + 1, int(np.floor((position - first) / step + 0.5)) + 1
    return (number, count) if 1 <= number <= count else None


def scan_outline(volume: Volume, plane: Plane, position: float) -> FloatArray:
    """Where a slice cuts the volume's voxels: a convex polygon (n, 2) of (across, down) mm in order, empty where it does not."""
    corners, n = _corners(volume), plane.normal
    found = []
    for a, b in _EDGES:
        p, q = corners[a], corners[b]
        if (p[n] - position) * (q[n] - position) <= 0.0 and p[n] != q[n]:
            found.append(p + (position - p[n]) / (q[n] - p[n]) * (q - p))
    if len(found) < 3:
        return np.zeros((0, 2))
    points = np.array(found)[:, [plane.across, plane.down]]
    from_middle = points - points.mean(axis=0)
    return np.asarray(points[np.argsort(np.arctan2(from_middle[:, 1], from_middle[:, 0]))])


def _own_voxels(volume: Volume, plane: Plane, position: float) -> SampledSlice | None:
    n, a, d = plane.normal, plane.across, plane.down
    origin, spacing = volume.affine[:3, 3], np.diag(volume.affine[:3, :3])
    index = int(np.floor((position - origin[n]) / spacing[n] + 0.5))
    if not 0 <= index < volume.array.shape[n]:
        return None
    selector: list[slice | int] = [slice(None)] * 3
    selector[n] = index
    values = volume.array[tuple(selector)].T  # the axes that are left run across, then down
    low = origin - spacing / 2.0
    high = low + spacing * volume.array.shape
    top, bottom = (low[d], high[d]) if plane.down_sign > 0 else (high[d], low[d])
    return SampledSlice(
        values if plane.down_sign > 0 else values[::-1], (float(low[a]), float(high[a]), float(bottom), float(top))
    )


def _sampled(
    volume: Volume,
    plane: Plane,
    position: float,
    fill: float,
    nearest: bool,
    region: tuple[float, float, float, float] | None,
) -> SampledSlice | None:
    n, a, d = plane.normal, plane.across, plane.down
    corners = _corners(volume)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not low[n] <= position <= high[n]:
        return None
    if region is not None:
        low[[a, d]] = np.maximum(low[[a, d]], [region[0], region[2]])
        high[[a, d]] = np.minimum(high[[a, d]], [region[1], region[3]])
    step = volume.spacing
    columns, rows = int(np.ceil((high[a] - low[a]) / step[a])), int(np.ceil((high[d] - low[d]) / step[d]))
    if columns < 1 or rows < 1:
        return None
    across = low[a] + (np.arange(columns) + 0.5) * step[a]
    down = low[d] + (np.arange(rows) + 0.5) * step[d]
    index = _indices(volume, plane, position, across, down if plane.down_sign > 0 else down[::-1])
    if nearest or rows * columns > _MOST_INTERPOLATED:
        values = _nearest(volume.array, index, fill)
    else:
        values = ndimage.map_coordinates(
            volume.array, index, volume.array.dtype, order=1, mode="constant", cval=fill, prefilter=False
        )
    first, last = float(low[d]), float(low[d] + rows * step[d])
    top, bottom = (first, last) if plane.down_sign > 0 else (last, first)
    return SampledSlice(values, (float(low[a]), float(low[a] + columns * step[a]), bottom, top))


def _indices(volume: Volume, plane: Plane, position: float, across: FloatArray, down: FloatArray) -> Float32Array:
    """Fractional indices (3, rows, columns) of the pixels of a slice; they are sums of a row's and a column's part."""
    inverse = np.linalg.inv(volume.affine)
    by_row = inverse[:3, plane.down, None] * down + inverse[:3, plane.normal, None] * position + inverse[:3, 3, None]
    by_column = inverse[:3, plane.across, None] * across
    return np.add(by_row[:, :, None], by_column[:, None, :], dtype=np.float32)


def _nearest(array: NDArray[np.generic], index: Float32Array, fill: float) -> NDArray[np.generic]:
    """The voxels nearest to fractional indices (3, rows, columns), ``fill`` outside."""
    array = array if array.flags.forc else np.ascontiguousarray(array)
    order: Literal["F", "C"] = "F" if array.flags.f_contiguous else "C"
    steps = np.array(array.strides) // array.itemsize
    nearest = np.rint(index).astype(np.int32)
    inside = np.ones(nearest.shape[1:], dtype=bool)
    for axis, count in enumerate(array.shape):
        inside &= nearest[axis].view(np.uint32) < np.uint32(count)  # negative ones are large there
    flat = nearest[0] * steps[0] + nearest[1] * steps[1] + nearest[2] * steps[2]
    values = np.full(flat.shape, fill, dtype=array.dtype)
    values[inside] = array.reshape(-1, order=order)[flat[inside]]
    return values


def _corners(volume: Volume) -> FloatArray:
    """The eight outer corners (8, 3) mm of the grid's outermost voxels."""
    ends = [(-0.5, n - 0.5) for n in volume.array.shape]
    return volume.to_lps(np.array([[i, j, k] for i in ends[0] for j in ends[1] for k in ends[2]]))
