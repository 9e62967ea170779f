"""A contoured scan as other scanners, protocols and patients would show it, by a recipe that is drawn.

What changes: noise, reconstruction kernel, slice thickness, scale and offset of HU, the field that was scanned, left and
right, contrast medium in the bladder, and the fat about the organs. The contours go along unchanged.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import BoolArray, Float32Array, FloatArray
from palpate.imaging.volume import Volume
from palpate.simulate.scanner import MAX_HU, MIN_HU
from palpate.validate.segmentation.contoured_scan import ContouredScan

# HU of soft tissue that takes the place of fat, and the range in which a voxel holds fat or part of it.
SOFT_HU, FAT_HU = 40.0, (-150.0, 25.0)
# How far about the organs fat is lost, mm; by how much its planes become thinner from each side at a share near 0; and
# the width of the new edges, as a scanner blurs them.
NEAR_MM, THINNER_MM, EDGE_MM = 45.0, 8.0, 0.7
# Slices kept beyond the organs where a field is cut off, mm.
LEAST_ROOM_MM = 12.0


@dataclass(frozen=True)
class Recipe:
    """One change of a scan.

    noise_hu : standard deviation of what is added. noise_blur_mm : its correlation. kernel_mm : standard deviation of a
    further blur; negative for a sharpening by as much. slice_mm : thickness of the new slices. scale, offset_hu : of HU
    above air. below_mm, above_mm : what is kept beyond the organs, infinite for all of it. mirrored : left for right.
    contrast_hu : added to the bladder's contents. fat : 1 for all of it, 0 for none about
    the organs; between, its planes are thinner by up to THINNER_MM from each side.
    """

    noise_hu: float = 0.0
    noise_blur_mm: float = 0.8
    kernel_mm: float = 0.0
    slice_mm: float = 0.0
    scale: float = 1.0
    offset_hu: float = 0.0
    below_mm: float = np.inf
    above_mm: float = np.inf
    mirrored: bool = False
    contrast_hu: float = 0.0
    fat: float = 1.0


def drawn_recipe(random: np.random.Generator) -> Recipe:
    """A recipe from the ranges that clinical scans have; each change is there in about half of them."""

    def sometimes(low: float, high: float, otherwise: float) -> float:
        return float(random.uniform(low, high)) if random.random() < 0.5 else otherwise

    return Recipe(
        noise_hu=sometimes(5.0, 30.0, 0.0),
        noise_blur_mm=float(random.uniform(0.4, 1.6)),
        kernel_mm=sometimes(-0.6, 1.2, 0.0),
        slice_mm=float(random.choice([1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0])),
        scale=sometimes(0.93, 1.07, 1.0),
        offset_hu=sometimes(-15.0, 15.0, 0.0),
        below_mm=sometimes(LEAST_ROOM_MM, 40.0, np.inf),
        above_mm=sometimes(LEAST_ROOM_MM, 40.0, np.inf),
        mirrored=bool(random.random() < 0.5),
        contrast_hu=float(random.choice([0.0, 0.0, 0.0, 60.0, 250.0])),
        fat=float(random.choice([1.0, 1.0, 0.6, 0.3, 0.0])),
    )


def variant_of(scan: ContouredScan, recipe: Recipe, seed: int) -> ContouredScan:
    """The scan and its contours as the recipe says. Axes of the scan's array are along LPS. Same seed, same noise."""
    organs = np.isin(scan.labels.array, [1, 2, 5, 6])
    hu = np.where(scan.ct.array < MIN_HU, MIN_HU, scan.ct.array).astype(np.float32)
    spacing = np.abs(scan.ct.spacing)
    hu = _with_less_fat(hu, organs, spacing, recipe.fat)
    hu = _with_contrast(hu, scan.labels.array == 5, spacing, recipe.contrast_hu)
    hu = _with_kernel(hu, spacing, recipe.kernel_mm)
    hu = hu + recipe.offset_hu * (hu > -900.0) + (recipe.scale - 1.0) * (hu + 1000.0) * (hu > -900.0)
    pick, affine = _slices(scan.ct, organs, recipe)
    hu = _averaged(hu, pick)
    hu = hu + _noise(hu.shape, spacing, recipe, seed)
    ct = Volume(np.rint(np.clip(hu, MIN_HU, MAX_HU)).astype(np.int16), affine)
    nearest = np.rint(pick.mean(axis=1)).astype(int)
    labels = Volume(np.ascontiguousarray(scan.labels.array[:, :, nearest]), affine)
    masks = {name: Volume(np.ascontiguousarray(m.array[:, :, nearest]), affine) for name, m in scan.masks.items()}
    found = ContouredScan(scan.name, ct, labels, {name: mask for name, mask in masks.items() if mask.array.any()})
    return _mirrored(found) if recipe.mirrored else found


def _with_less_fat(hu: Float32Array, organs: BoolArray, spacing: FloatArray, share: float) -> Float32Array:
    """Fat planes about the organs made thinner from both sides, or all of it soft tissue where the share is 0."""
    if share >= 1.0:
        return hu
    near = ndimage.distance_transform_edt(~organs, sampling=spacing) < NEAR_MM
    fat = (hu > FAT_HU[0]) & (hu < FAT_HU[1]) & ~organs
    gone = fat & near
    if share > 0.0:
        gone &= ndimage.distance_transform_edt(fat, sampling=spacing) < (1.0 - share) * THINNER_MM
    soft = ndimage.gaussian_filter(gone.astype(np.float32), EDGE_MM / spacing)
    part = np.where(gone, 1.0, np.where(fat, soft, 0.0)).astype(np.float32)
    return (hu + part * (SOFT_HU - hu)).astype(np.float32)


def _with_contrast(hu: Float32Array, bladder: BoolArray, spacing: FloatArray, added: float) -> Float32Array:
    """Medium in the bladder's lumen, 3 mm inside of the drawn wall, with a soft rim."""
    if added == 0.0 or not bladder.any():
        return hu
    deep = ndimage.distance_transform_edt(bladder, sampling=spacing)
    return np.where(bladder, hu + added / (1.0 + np.exp((3.0 - deep) / 0.6)), hu).astype(np.float32)


def _with_kernel(hu: Float32Array, spacing: FloatArray, sigma_mm: float) -> Float32Array:
    if sigma_mm == 0.0:
        return hu
    sigma = (abs(sigma_mm) / spacing[0], abs(sigma_mm) / spacing[1], 0.0)
    soft = ndimage.gaussian_filter(hu, sigma, mode="nearest")
    return soft if sigma_mm > 0.0 else (2.0 * hu - soft).astype(np.float32)


def _slices(ct: Volume, organs: BoolArray, recipe: Recipe) -> tuple[FloatArray, FloatArray]:
    """Where the new slices lie: places (n, 3) along the old third axis whose mean each is; and their affine."""
    step = float(ct.spacing[2])
    used = np.flatnonzero(organs.any(axis=(0, 1)))
    first = max(0.0, used[0] - recipe.below_mm / step)
    last = min(organs.shape[2] - 1.0, used[-1] + recipe.above_mm / step)
    width = (recipe.slice_mm or step) / step
    centres = np.arange(first, last + 1e-6, width)
    # A slice no thicker than the old ones is one of them or lies between two; a thicker one is a mean of three places.
    within = np.array([-0.33, 0.0, 0.33]) * width if width > 1.0 else np.zeros(1)
    pick = np.clip(centres[:, None] + within, 0.0, organs.shape[2] - 1.0)
    affine = ct.affine.copy()
    affine[:3, 3] = ct.affine[:3, 3] + ct.affine[:3, 2] * centres[0]
    affine[:3, 2] = ct.affine[:3, 2] * width
    return pick, affine


def _averaged(hu: Float32Array, pick: FloatArray) -> Float32Array:
    low = np.floor(pick).astype(int)
    high = np.minimum(low + 1, hu.shape[2] - 1)
    part = (pick - low).astype(np.float32)
    columns = [
        ((1.0 - part[:, m]) * hu[:, :, low[:, m]] + part[:, m] * hu[:, :, high[:, m]]) for m in range(pick.shape[1])
    ]
    return (sum(columns) / pick.shape[1]).astype(np.float32)


def _noise(shape: tuple[int, ...], spacing: FloatArray, recipe: Recipe, seed: int) -> Float32Array:
    if recipe.noise_hu == 0.0:
        return np.zeros(shape, dtype=np.float32)
    white = np.random.default_rng(seed).standard_normal(shape, dtype=np.float32)
    sigma = recipe.noise_blur_mm / spacing[:2]
    made = ndimage.gaussian_filter(white, (sigma[0], sigma[1], 0.0), mode="wrap")
    return (made * (recipe.noise_hu / float(made.std()))).astype(np.float32)


def _mirrored(scan: ContouredScan) -> ContouredScan:
    """Left and right exchanged in space; halves keep the label of the side they then lie on."""

    def turned(volume: Volume) -> Volume:
        return volume.with_array(np.ascontiguousarray(volume.array[::-1]))

    labels = turned(scan.labels)
    array = labels.array
    labels = labels.with_array(np.where(array == 1, 2, np.where(array == 2, 1, array)).astype(array.dtype))
    return ContouredScan(scan.name, turned(scan.ct), labels, {name: turned(mask) for name, mask in scan.masks.items()})
