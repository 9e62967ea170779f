"""The bladder: a homogeneous region of urine, and the wall around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.special import expit

from palpate.segmentation.organs.edges import mask_to_edges
from palpate.segmentation.organs.optimal_surface import crossing, optimal_surface, region_cost
from palpate.segmentation.organs.prompts import Prompts
from palpate.segmentation.organs.random_walk import walk
from palpate.segmentation.organs.scene import Found, Scene
from palpate.segmentation.organs.surface_mesh import Shell, profiles, shell_of_mask
from palpate.segmentation.organs.working_grid import Mask, blurred, dilated, eroded, largest, opened
from palpate.segmentation.volume import Volume

FloatArray = NDArray[np.float64]

# What urine without contrast medium can be, and the least and most above it that is half-way to its neighbours.
LOWEST_HU, ABOVE_HU = -24.0, (10.0, 15.0)
TRIED_HU = (8.0, 16.0, 24.0, 32.0)
# Erosion that parts the bladder from partial volume between fat and muscle, which has the same HU.
CORE_MM = 4.0
# Urine is even: its own noise, measured within it, tells it from everything else of its HU. Window of that measure, how
# much rougher than the core is still urine, and how far the HU may be off, in units of noise, or at least.
WINDOW_MM, ROUGHER, LIKE_SD, LIKE_HU, FINE_SIGMA_MM = 6.25, 2.0, 3.0, 10.0, 1.0
# A ball of this share of the largest one fits everywhere into a bladder, but for bulges as high as given.
ROUND_SHARE, ROUND_MM, BULGE_MM, SMOOTH_MM = 0.5, (3.0, 9.0), 8.0, 4.0
# The wall lies about this far from what is even (half the window), and nowhere further than FAR_MM.
REACH_MM, FAR_MM, ROOM_MM = 3.0, 10.0, 15.0
# A difference of neighbours that is an edge, in units of those in urine; and the prior's pull (see random_walk.py).
EDGE_SD, PULL = 2.0, 0.05
# Wall that is added where nothing tells it from its neighbour, and the most that is looked for against fat.
WALL_MM, THICKEST_MM = 0.0, 2.0
INWARD_MM, STEP_MM, STIFFNESS = 4.0, 0.5, 0.4
SMALLEST_CC, ENOUGH_CC = 6.0, 80.0
# Notches of this depth in the wall's outer surface are noise. Points and boxes are given this exactly.
NOTCH_MM, BOX_MM = 1.0, 1.0


@dataclass(frozen=True, eq=False)
class _Urine:
    """HU, noise and edge (HU) of the urine of a scan; the picture and its roughness that these are of."""

    hu: float
    noise: float
    edge: float
    fine: NDArray[np.float32]
    rough: NDArray[np.float64]


def find_bladder(scene: Scene, prompts: Prompts) -> Found | None:
    """The bladder, wall included; None where no urine is found."""
    smooth = blurred(scene.filled, 2.0, scene.step)
    allowed = _allowed(scene, prompts)
    point = prompts.point("bladder")
    core = _best_core(scene, smooth, allowed) if point is None else _core_at(scene, smooth, allowed, point)
    if core is None:
        return None
    urine = _urine_of(scene, core)
    region = _walked(scene, urine, _calm(urine, smooth, core, allowed, scene.step), allowed)
    shell, seen = _outer(scene, shell_of_mask(region, scene.grid, 1.5), urine.hu)
    mask = largest(np.asarray(ndimage.binary_fill_holes(shell.voxels(scene.grid))))
    # Noise that looks unlike urine at the wall leaves notches; the wall's outer edge closes them.
    mask = largest(mask_to_edges(scene, mask, NOTCH_MM))
    box = prompts.box("bladder")
    if box is not None:
        mask = largest(mask & scene.box_mask(box, BOX_MM))
    inner = eroded(mask, 3.0, scene.step)
    spread = float(smooth[inner].std()) if inner.any() else np.inf
    return Found(mask, prompts.mode("bladder"), _confidence(scene, mask, spread, seen))


def _allowed(scene: Scene, prompts: Prompts) -> Mask:
    """Where the bladder may be: above the symphysis' lower edge, in front of the sacrum, not near gas or bone."""
    box = prompts.box("bladder")
    near = scene.body & ~dilated(scene.gas, 3.0, scene.step) & ~scene.bone
    if box is not None:
        return near & scene.box_mask(box, 1.0)
    _, y, z = scene.axes()
    front = scene.pelvis.symphysis
    return near & (z > front[0, 2]) & (y > front[0, 1] - 20.0) & (y < front[1, 1] + 95.0)


def _best_core(scene: Scene, smooth: NDArray[np.float32], allowed: Mask) -> Mask | None:
    """The inner part of the region most like a bladder: large, low in HU, homogeneous, at the midline."""
    best, best_score = None, 0.0
    for high in TRIED_HU:
        inner = eroded((smooth > LOWEST_HU) & (smooth < high) & allowed, CORE_MM, scene.step)
        parts, count = ndimage.label(inner)
        sizes = np.bincount(parts.ravel(), minlength=count + 1)
        sizes[0] = 0
        for number in np.argsort(sizes)[::-1][:6]:
            if sizes[number] * scene.step**3 < 1000.0:
                break
            part = parts == number
            score = _score(scene, part, float(smooth[part].std())) * (1.0 - high / 80.0)
            if score > best_score:
                best, best_score = part, score
    return best


def _score(scene: Scene, part: Mask, spread: float) -> float:
    x, y, z = scene.grid.to_lps(np.argwhere(part).mean(axis=0)[None])[0]
    off = x - scene.pelvis.midline_x(y, z)
    size = min(scene.cc(part), ENOUGH_CC) / ENOUGH_CC
    top = scene.pelvis.symphysis[1, 2]
    high = max(0.0, abs(z - top - 15.0) - 35.0)
    return float(size * np.exp(-0.5 * (off / 25.0) ** 2 - 0.5 * (high / 20.0) ** 2) / (1.0 + (spread / 10.0) ** 2))


def _core_at(scene: Scene, smooth: NDArray[np.float32], allowed: Mask, point: FloatArray) -> Mask | None:
    """The inner part of the homogeneous region about a point."""
    at = scene.index(point)
    around = scene.box_mask(np.array([point, point]), 4.0) & allowed
    if not around.any():
        return None
    urine = float(np.median(smooth[around]))
    inner = eroded((np.abs(smooth - urine) < ABOVE_HU[1]) & allowed, CORE_MM, scene.step)
    parts, count = ndimage.label(inner)
    if count == 0:
        return None
    far, nearest = ndimage.distance_transform_edt(parts == 0, sampling=scene.step, return_indices=True)
    number = parts[tuple(nearest[(slice(None), *at)])]
    return np.asarray(parts == number) if far[at] < 15.0 else None


def _urine_of(scene: Scene, core: Mask) -> _Urine:
    """What the urine of this scan looks like, noise included."""
    fine = blurred(scene.filled, FINE_SIGMA_MM, scene.step)
    rough = _roughness(fine, scene.step)
    steps = [np.diff(fine, axis=a)[core.take(range(1, core.shape[a]), axis=a)] for a in range(3)]
    edge = EDGE_SD * float(np.sqrt(np.mean(np.concatenate(steps) ** 2)))
    return _Urine(float(np.median(fine[core])), float(np.median(rough[core])), max(edge, 0.5), fine, rough)


def _roughness(values: NDArray[np.float32], step: float) -> NDArray[np.float64]:
    """Standard deviation about each voxel: low within a fluid, high at walls and where vessels and fat mix to its HU."""
    width = max(3, round(WINDOW_MM / step) | 1)
    wide = values.astype(np.float64)
    square, mean = ndimage.uniform_filter(wide**2, width), ndimage.uniform_filter(wide, width)
    return np.asarray(np.sqrt(np.maximum(square - mean**2, 0.0)))


def _calm(urine: _Urine, smooth: NDArray[np.float32], core: Mask, allowed: Mask, step: float) -> Mask:
    """What is certainly bladder: of its HU, no rougher than it, and hanging together with where it was found."""
    like = np.abs(smooth - urine.hu) < max(LIKE_SD * urine.noise, LIKE_HU)
    calm = opened((urine.rough < ROUGHER * urine.noise) & like & allowed, SMOOTH_MM, step) | core
    parts, _ = ndimage.label(calm)
    calm &= np.isin(parts, np.unique(parts[core]))
    trunk = opened(calm, float(np.clip(ROUND_SHARE * _deepest(calm, step), *ROUND_MM)), step)
    return np.asarray(ndimage.binary_fill_holes(largest(calm & dilated(trunk, BULGE_MM, step))))


def _deepest(mask: Mask, step: float) -> float:
    return float(ndimage.distance_transform_edt(mask, sampling=step).max())


def _walked(scene: Scene, urine: _Urine, calm: Mask, allowed: Mask) -> Mask:
    """The calm part grown to the edges about it, by random walks."""
    near = _about(calm, round(ROOM_MM / scene.step))
    fine, far = urine.fine[near], ndimage.distance_transform_edt(~calm[near], sampling=scene.step)
    bright = urine.hu + float(np.clip(0.5 * (scene.muscle - urine.hu), *ABOVE_HU))
    dark = 0.5 * (urine.hu + scene.fat)
    prior = expit((bright - fine) / urine.noise) * expit((fine - dark) / (3.0 * urine.noise))
    prior *= expit((REACH_MM - far) / 0.7)
    outside = ~allowed[near] | (far > FAR_MM) | (fine < scene.fat_edge - 15.0)
    region = np.zeros_like(calm)
    region[near] = walk(fine, calm[near], outside, urine.edge, prior, PULL) > 0.5
    region = np.asarray(ndimage.binary_fill_holes(opened(largest(region), SMOOTH_MM, scene.step)))
    return largest(region)


def _about(mask: Mask, margin: int) -> tuple[slice, ...]:
    """The part of the grid that holds a mask, and a margin in voxels."""
    return tuple(
        slice(max(0, s.start - margin), s.stop + margin) for s in ndimage.find_objects(mask.astype(np.uint8))[0]
    )


def _outer(scene: Scene, shell: Shell, urine: float) -> tuple[Shell, float]:
    """The wall's outer surface, from the urine's, and the share of it that a contrast shows."""
    offsets = np.arange(-INWARD_MM, THICKEST_MM + 1e-6, STEP_MM)
    sharp = Volume(blurred(scene.hu, 0.8, scene.step), scene.grid.affine)
    values = profiles(sharp, shell.points, shell.normals, offsets)
    start = np.full(len(values), np.searchsorted(offsets, 0.0))
    fat = crossing(values, start, scene.fat_edge, len(offsets))
    against_fat = np.isfinite(fat)
    inside = np.clip((values - scene.fat_edge) / 40.0, -1.0, 1.0)
    # Against soft tissue the wall cannot be told from its neighbour: it ends a little beyond the urine.
    inside[~against_fat] = np.where(offsets < WALL_MM, 0.5, -0.5)
    found = optimal_surface(region_cost(inside), shell.edges, 1, STIFFNESS)
    near = crossing(values, found, scene.fat_edge, 2)
    place = np.where(np.isfinite(near), near, found + 0.5)
    move = shell.smoothed(offsets[0] + STEP_MM * place, 4)
    contrast = against_fat | (values[:, -1] > urine + ABOVE_HU[1])
    return Shell(shell.points + move[:, None] * shell.normals, shell.faces), float(contrast.mean())


def _confidence(scene: Scene, mask: Mask, spread: float, seen: float) -> float:
    """From size, evenness of the urine and the share of the surface that a contrast shows."""
    cc = scene.cc(mask)
    size = np.clip((cc - SMALLEST_CC) / 25.0, 0.0, 1.0) * np.clip((1500.0 - cc) / 500.0, 0.0, 1.0)
    even = 1.0 / (1.0 + (spread / 9.0) ** 2)
    return round(float(size * even * np.clip((seen - 0.3) / 0.5, 0.0, 1.0)), 3)
