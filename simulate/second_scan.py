"""The second scan of a real body: its CT without noise, moved, with other contents and fresh noise.

A CT that is moved as it is takes its noise along, and matching of the two scans would follow the noise.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray, LabelArray
from palpate.imaging.volume import Volume
from palpate.simulate.other_day import denoised, fresh_noise, noise_of, other_contents, seen_on_another_day
from palpate.simulate.scanner import voxel_mean

# How far around the labels the CT is denoised, mm. Beyond, its noise stays, as does the body.
_AROUND_MM = 30.0


@dataclass(frozen=True, eq=False)
class SecondScan:
    """spline : coefficients of the CT, denoised about the labels, with other contents. denoised_share : 1 there, 0 beyond.

    noise_hu : of the CT at rest.
    """

    spline: Volume
    denoised_share: Volume
    noise_hu: float

    @classmethod
    def of(
        cls, ct: Volume, region: Volume, labels_on: Callable[[Volume], Volume], random: np.random.Generator
    ) -> SecondScan:
        """Of a CT. region : label volume, 0 outside the modelled region. labels_on : labels on any grid."""
        part, crop = _crop(ct, region)
        labels: LabelArray = labels_on(crop).array
        noise_hu = _noise_hu(ct, region)
        values, share = ct.array.astype(np.float32), np.zeros(ct.array.shape, dtype=np.float32)
        values[part] = other_contents(denoised(crop.array, noise_hu), labels, crop.spacing, random)
        share[part] = 1.0
        spline = ndimage.spline_filter(values, order=3, output=np.float32, mode="nearest")
        return cls(ct.with_array(spline), ct.with_array(share), noise_hu)

    def seen(
        self,
        to_rest: Callable[[FloatArray], FloatArray],
        grid: Volume,
        changes: tuple[str, ...],
        random: np.random.Generator,
    ) -> Float32Array:
        """HU on a grid of the moved body, with what else `changes` name (`other_day.CHANGES`)."""
        moved = voxel_mean(lambda points: self._hu(to_rest(points)), grid, (1, 1, 1))
        fresh = voxel_mean(lambda points: self.denoised_share.at(to_rest(points)), grid, (1, 1, 1))
        other = seen_on_another_day(moved, grid.spacing, changes, random)
        sd = (1.5 if "noise" in changes else 1.0) * self.noise_hu
        return np.asarray(other + fresh * fresh_noise(moved.shape, grid.spacing, sd, random), dtype=np.float32)

    def _hu(self, points: FloatArray) -> FloatArray:
        index = self.spline.to_index(points).T
        values = ndimage.map_coordinates(self.spline.array, index, order=3, prefilter=False, mode="nearest")
        return np.asarray(values, dtype=np.float64)


def with_noise_anew(ct: Volume, region: Volume, random: np.random.Generator) -> Float32Array:
    """HU of a CT whose noise about the region is taken out and drawn anew, of the same size; arguments as of `SecondScan.of`.

    All pairs that are simulated from one CT share its noise otherwise, however many they are.
    """
    part, crop = _crop(ct, region)
    noise_hu = _noise_hu(ct, region)
    values = ct.array.astype(np.float32)
    values[part] = denoised(crop.array, noise_hu) + fresh_noise(crop.array.shape, crop.spacing, noise_hu, random)
    return values


def _noise_hu(ct: Volume, region: Volume) -> float:
    """Noise of a CT from the voxels nearest to those of the region, the same for each pair of one body."""
    places = region.to_lps(np.indices(region.array.shape).reshape(3, -1).T.astype(float))
    nearest = np.clip(np.rint(ct.to_index(places)).astype(int), 0, np.array(ct.array.shape) - 1)
    hu = ct.array[tuple(nearest.T)].reshape(region.array.shape).astype(np.float32)
    return noise_of(hu, region.array, region.spacing)


def _crop(ct: Volume, region: Volume) -> tuple[tuple[slice, ...], Volume]:
    """Which voxels of a CT are denoised, and these (float32)."""
    part = _box(ct, region)
    affine = ct.affine.copy()
    affine[:3, 3] = ct.to_lps(np.array([[s.start for s in part]], dtype=float))[0]
    return part, Volume(ct.array[part].astype(np.float32), affine)


def _box(ct: Volume, region: Volume) -> tuple[slice, ...]:
    """The CT's voxels within _AROUND_MM of the region's bounding box."""
    places = region.to_lps(np.argwhere(region.array > 0).astype(float))
    low, high = places.min(axis=0) - _AROUND_MM, places.max(axis=0) + _AROUND_MM
    index = ct.to_index(np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1).T)
    start = np.maximum(np.floor(index.min(axis=0)).astype(int), 0)
    stop = np.minimum(np.ceil(index.max(axis=0)).astype(int) + 1, ct.array.shape)
    return tuple(slice(int(a), int(b)) for a, b in zip(start, stop, strict=True))
