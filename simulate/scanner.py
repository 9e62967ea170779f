"""What a CT scanner makes of a body: blur by its point spread, averaging over the slice, correlated noise, whole HU."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray
from palpate.imaging.volume import Volume

# HU (n,) at points (n, 3) mm in the scanner's coordinates.
HounsfieldField = Callable[[FloatArray], FloatArray]

MIN_HU, MAX_HU = -1024, 3071
_SLAB_POINTS = 400_000


@dataclass(frozen=True)
class Scanner:
    """How a scanner sees.

    blur_mm : standard deviation of the in-plane point spread (full width 2.35 times that).
    noise_hu : standard deviation of the noise in the middle of the body; less towards the skin, a third in air.
    noise_blur_mm : how far the reconstruction kernel correlates the noise, standard deviation.
    samples : points per voxel along i, j, k at which the body is asked.
    """

    blur_mm: float = 0.5
    noise_hu: float = 12.0
    noise_blur_mm: float = 0.75
    samples: tuple[int, int, int] = (1, 1, 2)

    def scan(self, body: HounsfieldField, grid: Volume, seed: int) -> Volume:
        """The CT (int16, HU) of a body on a grid, whose values do not matter. Same seed, same noise."""
        clean = self.expose(body, grid)
        noisy = clean + self._noise(clean, grid.spacing, seed)
        return grid.with_array(np.rint(np.clip(noisy, MIN_HU, MAX_HU)).astype(np.int16))

    def expose(self, body: HounsfieldField, grid: Volume) -> Float32Array:
        """The picture (ni, nj, nk) without noise, HU: mean over each voxel, then the point spread."""
        mean = voxel_mean(body, grid, self.samples)
        sigma = self.blur_mm / grid.spacing
        return ndimage.gaussian_filter(mean, (sigma[0], sigma[1], 0.0), mode="nearest")

    def _noise(self, clean: Float32Array, spacing: FloatArray, seed: int) -> Float32Array:
        white = np.random.default_rng(seed).standard_normal(clean.shape, dtype=np.float32)
        sigma = self.noise_blur_mm / spacing
        noise = ndimage.gaussian_filter(white, (sigma[0], sigma[1], 0.3 * sigma[2]), mode="wrap")
        # Rays through the middle of the body meet the most matter and leave the fewest photons.
        matter = ndimage.gaussian_filter((clean > -500.0).astype(np.float32), (40.0 / spacing[0], 40.0 / spacing[1], 0))
        matter /= max(float(matter.max()), 1e-6)
        return noise * (self.noise_hu / float(noise.std())) * (0.33 + 0.67 * np.clip(matter, 0.0, 1.0))


def voxel_mean(body: HounsfieldField, grid: Volume, samples: tuple[int, int, int]) -> Float32Array:
    """Mean (ni, nj, nk) of a field over evenly spread points in each voxel."""
    shape = grid.array.shape
    result = np.empty(shape, dtype=np.float32)
    offsets = [(np.arange(n) + 0.5) / n - 0.5 for n in samples]
    inner = np.stack(np.meshgrid(*offsets, indexing="ij"), axis=-1).reshape(-1, 3)
    thick = max(1, _SLAB_POINTS // (shape[0] * shape[1]))
    for start in range(0, shape[2], thick):
        stop = min(start + thick, shape[2])
        index = np.stack(
            np.meshgrid(*(np.arange(n) for n in shape[:2]), np.arange(start, stop), indexing="ij"), axis=-1
        )
        flat = index.reshape(-1, 3).astype(np.float64)
        total = np.zeros(len(flat))
        for offset in inner:
            total += body(grid.to_lps(flat + offset))
        result[:, :, start:stop] = (total / len(inner)).reshape(*shape[:2], stop - start)
    return result
