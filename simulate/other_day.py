"""What differs between two scans of one patient besides motion: noise, contents, contrast, kernel, streaks, slices."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy import ndimage
from skimage.restoration import denoise_nl_means

from palpate.core.arrays import BoolArray, Float32Array, FloatArray, LabelArray
from palpate.imaging.labels import BLADDER, RECTUM
from palpate.imaging.volume import Volume

# Changes that a pair may have beside motion and contents.
CHANGES = ("contrast", "kernel", "noise", "streaks", "slices")
# Strength of the denoising in units of the noise; noise where the bladder does not show it, HU; correlation of a
# scanner's noise, standard deviation of its filter, mm.
DENOISING, USUAL_NOISE_HU, NOISE_BLUR_MM = 1.0, 12.0, np.array([0.7, 0.7, 0.3])
# Contents: urine's HU, and stool's mean, spread and size of lumps; how sharply contents end, mm.
URINE_HU, STOOL_HU, STOOL_SD_HU, LUMP_MM, END_MM = (0.0, 60.0), -20.0, 120.0, 5.0, 1.0
# Contrast: tissue gains this share of its HU above fat's, and an uneven brightness of this size and length.
GAIN, FAT_HU, UNEVEN_HU, UNEVEN_MM = 0.15, -100.0, 8.0, 30.0
# Kernel: another scanner's blur within the slice, mm. Streaks between the hips: size, width across, mm.
KERNEL_MM, STREAK_HU, STREAK_MM = 0.8, 12.0, 2.0
# What a wall leaves of its organ's contour for the contents, mm.
_WALL_MM = 3.0
_MIRROR = (slice(None, None, -1),) * 3


def denoised(hu: Float32Array, noise_hu: float) -> Float32Array:
    """The scan without its noise of that standard deviation: non-local means (Buades and others 2005). Not to be written to.

    The quick form of scikit-image 0.26 moves texture by about a fifth of a voxel along each axis, bone hardly. The mean over
    the scan and its mirror image moves nothing. It takes minutes on a CT; of the last two scans it is kept, for all pairs of a
    study are made from a few.
    """
    return _denoised(_Scan(hashlib.sha256(np.ascontiguousarray(hu).data).hexdigest(), hu), noise_hu)


@dataclass(frozen=True)
class _Scan:
    """A scan that is known by its digest."""

    digest: str
    hu: Float32Array = field(compare=False)


@lru_cache(maxsize=2)
def _denoised(scan: _Scan, noise_hu: float) -> Float32Array:
    there, back = (_non_local_means(np.ascontiguousarray(part), noise_hu) for part in (scan.hu, scan.hu[_MIRROR]))
    found = np.asarray(0.5 * (there + back[_MIRROR]), dtype=np.float32)
    found.setflags(write=False)
    return found


def _non_local_means(hu: Float32Array, noise_hu: float) -> Float32Array:
    found = denoise_nl_means(hu, patch_size=3, patch_distance=4, h=DENOISING * noise_hu, sigma=noise_hu, fast_mode=True)
    return np.asarray(found, dtype=np.float32)


def noise_of(hu: Float32Array, labels: LabelArray, spacing: FloatArray) -> float:
    """Standard deviation, HU, of the urine 6 mm within the bladder's contour."""
    inner = ndimage.distance_transform_edt(labels == BLADDER, sampling=spacing) > 6.0
    return float(hu[inner].std()) if inner.any() else USUAL_NOISE_HU


def fresh_noise(shape: tuple[int, ...], spacing: FloatArray, sd: float, random: np.random.Generator) -> Float32Array:
    """A scanner's noise (ni, nj, nk) HU of that standard deviation."""
    made = ndimage.gaussian_filter(random.standard_normal(shape, dtype=np.float32), NOISE_BLUR_MM / spacing)
    return np.asarray(made * (sd / made.std()), dtype=np.float32)


def other_contents(
    hu: Float32Array, labels: LabelArray, spacing: FloatArray, random: np.random.Generator
) -> Float32Array:
    """The scan with urine of another HU and other stool and gas."""
    out = hu.copy()
    lumps = ndimage.gaussian_filter(random.standard_normal(hu.shape), LUMP_MM / spacing)
    stool = np.clip(STOOL_HU + STOOL_SD_HU * lumps / lumps.std(), -300.0, 120.0)
    for organ, contents in ((BLADDER, np.full(hu.shape, random.uniform(*URINE_HU))), (RECTUM, stool)):
        inside: BoolArray = ndimage.distance_transform_edt(labels == organ, sampling=spacing) > _WALL_MM
        share = ndimage.gaussian_filter(inside.astype(np.float32), END_MM / spacing)
        out = (1.0 - share) * out + share * contents
    return np.asarray(out, dtype=np.float32)


def seen_on_another_day(
    hu: Float32Array, spacing: FloatArray, changes: Collection[str], random: np.random.Generator
) -> Float32Array:
    """The scan with contrast, another kernel and streaks, where `changes` name them; noise and slices come after."""
    out = hu
    if "contrast" in changes:
        uneven = ndimage.gaussian_filter(random.standard_normal(hu.shape, dtype=np.float32), UNEVEN_MM / spacing)
        out = out + GAIN * np.maximum(out - FAT_HU, 0.0) + UNEVEN_HU * (uneven - uneven.mean()) / uneven.std()
    if "kernel" in changes:
        out = ndimage.gaussian_filter(out, np.array([KERNEL_MM, KERNEL_MM, 0.0]) / spacing)
    if "streaks" in changes:
        across = ndimage.gaussian_filter(random.standard_normal(hu.shape[1:]), (STREAK_MM / spacing[1], 0.0))
        out = out + STREAK_HU * across[None] / across.std()
    return np.asarray(out, dtype=np.float32)


def thicker_slices(volume: Volume) -> Volume:
    """Slices twice as thick, each the mean of two."""
    count = volume.array.shape[2] // 2
    both = volume.array[:, :, : 2 * count].reshape(*volume.array.shape[:2], count, 2).mean(axis=3)
    affine = volume.affine.copy()
    affine[:3, 3] = volume.to_lps(np.array([[0.0, 0.0, 0.5]]))[0]
    affine[:3, 2] *= 2.0
    return Volume(np.asarray(both, dtype=np.float32), affine)
