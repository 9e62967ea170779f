"""The urine in a bladder: an even fluid, told from its neighbours by its own noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.special import expit

from palpate.core.arrays import Float32Array, FloatArray
from palpate.segmentation.methods.random_walker import walk
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask, blurred, depth_of, dilated, distance_to, filled, largest, opened

# The least and most above urine's HU that is half-way to its neighbours.
ABOVE_HU = (10.0, 15.0)
# Urine is even: its own noise, measured within it, tells it from everything else of its HU. Window of that measure, how
# much rougher than the core is still urine, and how far the HU may be off, in units of noise, or at least.
WINDOW_MM, ROUGHER, LIKE_SD, LIKE_HU, FINE_SIGMA_MM = 6.25, 2.0, 3.0, 10.0, 1.0
# A ball of this share of the largest one fits everywhere into a bladder, but for bulges as high as given.
ROUND_SHARE, ROUND_MM, BULGE_MM, SMOOTH_MM, CORRIDOR_MM = 0.5, (3.0, 9.0), 8.0, 4.0, 3.0
# The wall lies about this far from what is even (half the window), and nowhere further than FAR_MM.
REACH_MM, FAR_MM, ROOM_MM = 3.0, 10.0, 15.0
# Urine that is so far above muscle holds medium: its edge is steeper than any other's.
MEDIUM_HU = 60.0
# A difference of neighbours that is an edge, in units of those in urine; and the prior's pull (see random_walk.py).
EDGE_SD, PULL = 2.0, 0.05


@dataclass(frozen=True, eq=False)
class Urine:
    """HU, noise and edge (HU) of the urine of a scan; the picture and its roughness that these are of; and half of what muscle
    differs from it (HU)."""

    hu: float
    noise: float
    edge: float
    fine: Float32Array
    rough: FloatArray
    half_way: float = np.inf


def urine_of(scene: Scene, core: Mask) -> Urine:
    """What the urine of this scan looks like, noise included."""
    fine = blurred(scene.filled, FINE_SIGMA_MM, scene.step)
    rough = _roughness(fine, scene.step)
    steps = [np.diff(fine, axis=a)[core.take(range(1, core.shape[a]), axis=a)] for a in range(3)]
    edge = EDGE_SD * float(np.sqrt(np.mean(np.concatenate(steps) ** 2)))
    # A picture without noise still has its own rounding.
    noise = max(float(np.median(rough[core])), 0.5)
    hu = float(np.median(fine[core]))
    return Urine(hu, noise, max(edge, 0.5), fine, rough, 0.5 * abs(scene.muscle - hu))


def _roughness(values: Float32Array, step: float) -> FloatArray:
    """Standard deviation about each voxel: low within a fluid, high at walls and where vessels and fat mix to its HU."""
    width = max(3, round(WINDOW_MM / step) | 1)
    wide = values.astype(np.float64)
    square, mean = ndimage.uniform_filter(wide**2, width), ndimage.uniform_filter(wide, width)
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))


def _calm(urine: Urine, smooth: Float32Array, core: Mask, allowed: Mask, step: float) -> Mask:
    """What is certainly bladder: of its HU, no rougher than it, and hanging together with where it was found."""
    # However noisy a scan is, what is nearer to muscle than to urine is none.
    like = np.abs(smooth - urine.hu) < max(min(LIKE_SD * urine.noise, urine.half_way), LIKE_HU)
    # A nearly empty bladder holds no large ball.
    least = ROUND_SHARE * depth_of(core, step)
    calm = opened((urine.rough < ROUGHER * urine.noise) & like & allowed, min(SMOOTH_MM, least), step) | core
    parts, _ = ndimage.label(calm)
    calm &= np.isin(parts, np.unique(parts[core]))
    trunk = opened(calm, float(np.clip(ROUND_SHARE * depth_of(calm, step), min(ROUND_MM[0], least), ROUND_MM[1])), step)
    # Corridors of the core, along vessels and at corners where fat and muscle mix to urine's HU, hold no ball.
    kept = opened(calm & dilated(trunk, BULGE_MM, step), min(CORRIDOR_MM, least), step) | trunk
    return filled(largest(kept))


def urine_region(scene: Scene, urine: Urine, smooth: Float32Array, core: Mask, allowed: Mask) -> Mask:
    """The urine about a core, grown to the edges around it by random walks; nothing where all is too thin.

    smooth : HU, blurred by 2 mm. allowed : where the bladder may be. Medium ends at half its height above muscle instead.
    """
    if urine.hu > scene.muscle + MEDIUM_HU:
        return _half_height(scene, urine, core, allowed)
    calm = _calm(urine, smooth, core, allowed, scene.step)
    return _walked(scene, urine, calm, allowed) if calm.any() else calm


def _half_height(scene: Scene, urine: Urine, core: Mask, allowed: Mask) -> Mask:
    """Medium to where it is half as far above muscle as in the core: as far as the scan's blur leaves the edge in place."""
    bright = (urine.fine > 0.5 * (urine.hu + scene.muscle)) & allowed
    parts, _ = ndimage.label(opened(bright, CORRIDOR_MM, scene.step) | core)
    return filled(np.isin(parts, np.unique(parts[core])))


def _walked(scene: Scene, urine: Urine, calm: Mask, allowed: Mask) -> Mask:
    """The calm part grown to the edges about it, by random walks."""
    near = _about(calm, round(ROOM_MM / scene.step))
    fine, far = urine.fine[near], distance_to(calm[near], scene.step)
    bright = urine.hu + float(np.clip(0.5 * (scene.muscle - urine.hu), *ABOVE_HU))
    dark = 0.5 * (urine.hu + scene.fat)
    prior = expit((bright - fine) / urine.noise) * expit((fine - dark) / (3.0 * urine.noise))
    prior *= expit((REACH_MM - far) / 0.7)
    outside = ~allowed[near] | (far > FAR_MM) | (fine < scene.fat_edge - 15.0)
    region = np.zeros_like(calm)
    region[near] = walk(fine, calm[near], outside, urine.edge, prior, PULL) > 0.5
    region = filled(opened(largest(region), SMOOTH_MM, scene.step))
    return largest(region)


def _about(mask: Mask, margin: int) -> tuple[slice, ...]:
    """The part of the grid that holds a mask, and a margin in voxels."""
    return tuple(
        slice(max(0, s.start - margin), s.stop + margin) for s in ndimage.find_objects(mask.astype(np.uint8))[0]
    )
