"""Two scans made alike for matching: one resolution, one grid, and the second as it lies under a motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, Float32Array, FloatArray, IntArray
from palpate.imaging.matching.window_sums import Windows
from palpate.imaging.sampling import under_motion
from palpate.imaging.volume import Volume

# Displacements (n, 3) mm at points (n, 3) mm.
Motion = Callable[[FloatArray], FloatArray]

# Share of usable voxels about a place of the second scan from which on it counts as usable.
_USABLE = 0.95


@dataclass(frozen=True, eq=False)
class ScanPair:
    """Both scans at one resolution.

    first : (ni, nj, nk) HU. usable : voxels of it that have a counterpart. active (a, 3) : indices of those voxels and
    their neighbours; index (a, 3), where the second scan's grid shows them by the prediction. second : coefficients of its
    cubic spline. other_usable : share of usable voxels.
    """

    grid: Volume
    windows: Windows
    first: Float32Array
    usable: BoolArray
    active: IntArray
    index: FloatArray
    second: Volume
    other_usable: Volume

    @classmethod
    def of(
        cls,
        first: Volume,
        second: Volume,
        usable: tuple[BoolArray, BoolArray],
        predicted: Motion,
        smoothing_mm: float,
        window_mm: float,
    ) -> ScanPair:
        """A pair at the resolution of a Gaussian filter of `smoothing_mm`, or the coarser scan's voxels where they are larger."""
        ours, theirs = _filters(first.spacing, second.spacing, smoothing_mm)
        smooth = ndimage.gaussian_filter(first.array.astype(np.float32), ours / first.spacing)
        stride = tuple(slice(None, None, max(int(smoothing_mm / s), 1)) for s in first.spacing)
        grid, counts = _strided(first, stride), usable[0][stride]
        smooth = np.ascontiguousarray(smooth[stride])
        other = ndimage.gaussian_filter(second.array.astype(np.float32), theirs / second.spacing)
        active = np.argwhere(ndimage.binary_dilation(counts, iterations=1))
        places = grid.to_lps(active.astype(float))
        return cls(
            grid, Windows.of(grid, window_mm), smooth, counts, active, second.to_index(places + predicted(places)),
            second.with_array(ndimage.spline_filter(other, order=3, output=np.float32, mode="nearest")),
            second.with_array(usable[1].astype(np.float32)),
        )  # fmt: skip

    def moved(self, beyond: FloatArray) -> tuple[Float32Array, Float32Array]:
        """The second scan as it lies under the prediction and a motion beyond it (mi, mj, mk, 3) mm of the windows' nodes, and
        the weight of every voxel: 1 where both scans are usable."""
        turned = beyond @ np.linalg.inv(self.second.affine[:3, :3]).T
        there, seen = under_motion(
            self.second.array, self.other_usable.array, self.active, self.index, turned, self.windows.ends
        )
        voxels = tuple(self.active.T)
        values, weight = self.first.copy(), np.zeros_like(self.first)
        values[voxels] = there
        weight[voxels] = (seen > _USABLE) & self.usable[voxels]
        return values, weight


def _filters(ours: FloatArray, theirs: FloatArray, smoothing_mm: float) -> tuple[FloatArray, FloatArray]:
    """Standard deviations (3,) mm of the filters that give both scans one resolution; a voxel is a box of variance h^2 / 12."""
    a, b = (np.full(3, smoothing_mm**2) + h**2 / 12.0 for h in (ours, theirs))
    common = np.maximum(a, b)
    return np.sqrt(common - ours**2 / 12.0), np.sqrt(common - theirs**2 / 12.0)


def _strided(volume: Volume, stride: tuple[slice, ...]) -> Volume:
    affine = volume.affine.copy()
    affine[:3, :3] = affine[:3, :3] * [s.step for s in stride]
    return Volume(volume.array[stride], affine)
