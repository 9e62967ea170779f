"""The core of a bladder: of all regions of one HU, the one that is most like a body of fluid behind and above the symphysis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask, box_around, depth_of, distance_to, eroded

# What urine without contrast medium can be, and how far above its own median it still counts.
LOWEST_HU, ABOVE_HU = -24.0, 15.0
TRIED_HU = (8.0, 16.0, 24.0, 32.0)
# With medium it is brighter than muscle by so much at least, a little or a lot, and at most; how much less likely that is than plain urine.
MEDIUM_HU, MEDIUM_SHARE = ((10.0, 100.0), (60.0, 1000.0)), 0.8
# By so much plain urine stands out from muscle.
PLAIN_HU = 40.0
# Erosion that parts the bladder from partial volume between fat and muscle, which has the same HU; and the one that leaves a core of a
# nearly empty bladder, which is tried where nothing was found that scores so much.
CORE_MM, SMALL_CORE_MM, SURE_SCORE = 4.0, 2.5, 0.2
# Urine with a little medium has muscle's HU, give or take so much: nothing but its evenness, and fat on nearly all sides of it, tells it.
# It is tried where nothing else is sure, with an erosion that parts it from prostate and muscles, and must score so much. Chosen between
# 0.5, the best of what was none on nine variants, and 0.9, a bladder's.
DILUTE_HU, DILUTE_CORE_MM, DILUTE_SCORE = 15.0, 6.0, 0.7
# Cores smaller than this are noise. Larger bladders than the second are no likelier than it; a smaller one is, as the root of its volume.
LEAST_CORE_CC, ENOUGH_CC, TRIED_PARTS = 0.3, 80.0, 6
# A fluid is even: HU by which it may vary beyond the scan's noise. Noise is told where soft tissue is smoothest, this share of it.
UNEVEN_HU, SMOOTHEST, WINDOW_MM = 5.0, 0.1, 6.25
# What surrounds a core is looked at so far beyond its erosion, mm.
AROUND_MM = (4.0, 8.0)
# Its centre lies no farther behind the symphysis than that of a ball of 600 cc that touches it; and how sharply that ends, mm.
BEHIND_MM, BEHIND_SD_MM = 50.0, 15.0
# A core's depth against the radius of a ball of its volume: less than this is a sheet, as muscles are.
ROUND = 0.4


@dataclass(frozen=True, eq=False)
class _Picture:
    """A part of the scene: HU blurred by 2 mm, where the bladder may be, and the noise of the blurred picture, HU."""

    scene: Scene
    near: tuple[slice, ...]
    smooth: Float32Array
    allowed: Mask
    noise: float


def best_core(scene: Scene, smooth: Float32Array, allowed: Mask) -> Mask | None:
    """The inner part of the region most like a bladder: large, low in HU or brighter than muscle, even, unlike what surrounds it on all
    sides, no sheet, at the midline. None where there is nothing of the kind."""
    if not allowed.any():
        return None
    near = box_around(allowed, (SMALL_CORE_MM + AROUND_MM[1]) / scene.step)
    picture = _Picture(scene, near, smooth[near], allowed[near], _noise(scene, smooth))
    best, score = _best_of(picture, CORE_MM, _tried(scene.muscle))
    if score < SURE_SCORE:
        dilute, dilute_score = _best_of(
            picture, DILUTE_CORE_MM, [(scene.muscle - DILUTE_HU, scene.muscle + DILUTE_HU, 1.0)]
        )
        small, small_score = _best_of(picture, SMALL_CORE_MM, _tried(scene.muscle))
        best = small if small_score > score else best
        best = dilute if dilute_score > DILUTE_SCORE else best
    if best is None:
        return None
    found = np.zeros(allowed.shape, dtype=bool)
    found[near] = best
    return found


def core_at(scene: Scene, smooth: Float32Array, allowed: Mask, point: FloatArray) -> Mask | None:
    """The inner part of the homogeneous region about a point."""
    at = scene.index(point)
    around = scene.box_mask(np.array([point, point]), 4.0) & allowed
    if not around.any():
        return None
    urine = float(np.median(smooth[around]))
    inner = eroded((np.abs(smooth - urine) < ABOVE_HU) & allowed, CORE_MM, scene.step)
    parts, count = ndimage.label(inner)
    if count == 0:
        return None
    far, nearest = ndimage.distance_transform_edt(parts == 0, sampling=scene.step, return_indices=True)
    number = parts[tuple(nearest[(slice(None), *at)])]
    return np.asarray(parts == number) if far[at] < 15.0 else None


def _tried(muscle: float) -> list[tuple[float, float, float]]:
    """Ranges of HU in which urine may lie, plain or with medium, and how likely each is."""
    plain = [(LOWEST_HU, high, 1.0 - high / 80.0) for high in TRIED_HU]
    return plain + [(muscle + least, muscle + most, MEDIUM_SHARE) for least, most in MEDIUM_HU]


def _best_of(
    picture: _Picture, erosion_mm: float, tried: Sequence[tuple[float, float, float]]
) -> tuple[Mask | None, float]:
    """The best core of all ranges of HU after an erosion, and its score. tried : lowest and highest HU, and how likely."""
    best, best_score = None, 0.0
    voxel_cc = picture.scene.step**3 / 1000.0
    for low, high, likely in tried:
        like = (picture.smooth > low) & (picture.smooth < high) & picture.allowed
        parts, count = ndimage.label(eroded(like, erosion_mm, picture.scene.step))
        sizes = np.bincount(parts.ravel(), minlength=count + 1)
        sizes[0] = 0
        for number in np.argsort(sizes)[::-1][:TRIED_PARTS]:
            if sizes[number] * voxel_cc < LEAST_CORE_CC:
                break
            part = parts == number
            # Most of the score costs little: what cannot win by it is not looked at further.
            score = likely * _by_size_and_place(picture, part, erosion_mm) * _evenness(picture, part)
            if score > best_score:
                score *= _form_and_contrast(picture, part, erosion_mm)
            if score > best_score:
                best, best_score = part, score
    return best, best_score


def _noise(scene: Scene, smooth: Float32Array) -> float:
    """Noise of the blurred picture, HU: standard deviation about voxels of soft tissue where it is smoothest."""
    width = max(3, round(WINDOW_MM / scene.step) | 1)
    soft = scene.body & ~scene.bone & ~scene.gas & (smooth > LOWEST_HU) & (smooth < scene.muscle + PLAIN_HU)
    wide = smooth.astype(np.float64)
    square, mean = ndimage.uniform_filter(wide**2, width), ndimage.uniform_filter(wide, width)
    rough = np.sqrt(np.maximum(square - mean**2, 0.0))[soft]
    return float(np.quantile(rough, SMOOTHEST)) if len(rough) else 0.0


def _by_size_and_place(picture: _Picture, part: Mask, erosion_mm: float) -> float:
    scene, corner = picture.scene, np.array([s.start for s in picture.near])
    x, y, z = scene.grid.to_lps((np.argwhere(part).mean(axis=0) + corner)[None])[0]
    off = x - scene.pelvis.midline_x(y, z)
    high = max(0.0, abs(z - scene.pelvis.symphysis[1, 2] - 15.0) - 35.0)
    behind = max(0.0, y - scene.pelvis.symphysis[1, 1] - BEHIND_MM)
    far = (off / 25.0) ** 2 + (high / 20.0) ** 2 + (behind / BEHIND_SD_MM) ** 2
    whole = 4.0 / 3.0 * np.pi * (_ball_radius(scene, part) + erosion_mm) ** 3 / 1000.0
    size = np.sqrt(min(whole, ENOUGH_CC) / ENOUGH_CC)
    return float(size * np.exp(-0.5 * far))


def _evenness(picture: _Picture, part: Mask) -> float:
    values = picture.smooth[part]
    # Medium may be as much less even as it stands out more.
    above = max(float(np.median(values)) - picture.scene.muscle, PLAIN_HU) / PLAIN_HU
    beyond = max(float(values.var()) - picture.noise**2, 0.0)
    return float(1.0 / (1.0 + beyond / (UNEVEN_HU * above) ** 2))


def _form_and_contrast(picture: _Picture, part: Mask, erosion_mm: float) -> float:
    """How round a core is, times how much of its surroundings differs from it."""
    step = picture.scene.step
    box = box_around(part, (erosion_mm + AROUND_MM[1]) / step)
    inside, values = part[box], picture.smooth[box]
    away = distance_to(inside, step)
    ring = (
        (away > erosion_mm + AROUND_MM[0]) & (away < erosion_mm + AROUND_MM[1]) & ~picture.scene.gas[picture.near][box]
    )
    if not ring.any():
        return 0.0
    differs = np.clip(np.abs(values[ring] - float(np.median(values[inside]))) / PLAIN_HU, 0.0, 1.0)
    depth = depth_of(inside, step)
    form = min(1.0, depth / _ball_radius(picture.scene, part) / ROUND)
    return float(form * differs.mean())


def _ball_radius(scene: Scene, part: Mask) -> float:
    """Radius of the ball of a mask's volume, mm."""
    return float((3.0 * part.sum() / (4.0 * np.pi)) ** (1.0 / 3.0) * scene.step)
