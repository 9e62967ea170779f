"""The bladder: a homogeneous region of urine, and the wall around it."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.volume import Volume
from palpate.segmentation.bladder.core import ABOVE_HU, best_core, core_at
from palpate.segmentation.bladder.urine import urine_of, urine_region
from palpate.segmentation.methods.optimal_surface import crossing, optimal_surface, region_cost
from palpate.segmentation.methods.subvoxel_edges import mask_to_edges
from palpate.segmentation.methods.surface_mesh import Shell, profiles, shell_of_mask
from palpate.segmentation.points_fit import MOST_OFF_MM, between, held_to, misses, ran_away, shape_within
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.working_grid import Mask, blurred, depth_of, dilated, eroded, filled, largest, opened

# Wall that is added where nothing tells it from its neighbour, and the most that is looked for against fat.
WALL_MM, THICKEST_MM = 0.0, 2.0
# The same where medium, brighter than muscle, shows the wall's inner side: a filled bladder's wall is about 3 mm thick.
MEDIUM_WALL_MM, MEDIUM_THICKEST_MM = 3.0, 5.0
INWARD_MM, STEP_MM, STIFFNESS = 4.0, 0.5, 0.4
SMALLEST_CC, LEAST_CC = 6.0, 1.0
# Notches of this depth in the wall's outer surface are noise. Points and boxes are given this exactly.
# About points there is room to see how far a surface overshoots them all.
NOTCH_MM, BOX_MM, ROOM_MM = 1.0, 1.0, 6.0
# Where less of the surface shows a contrast, what points say of the shape counts as much as the picture.
SEEN_SHARE = 0.5
# A filled bladder has no tails: a ball of this share of its depth, at most so large, fits everywhere. What it cannot enter
# is vessels, seminal vesicles or the side wall, which have the wall's HU and touch it.
BALL_SHARE, BALL_MM = 0.4, 8.0


def find_bladder(scene: Scene, prompts: Prompts, taken: Mask | None = None) -> Found | None:
    """The bladder, wall included; None where no urine is found and no six points are given. taken : what is another organ."""
    blocked = scene.bone if taken is None else scene.bone | taken
    drawn = _drawn(scene, prompts, blocked)
    mask, seen = drawn if drawn is not None else (None, 0.0)
    box, points = prompts.box("bladder"), prompts.extremes.get("bladder")
    if points is not None:
        mask = _with_points(scene, points, blocked, mask, seen)
    if mask is None or not mask.any():
        return None
    if box is not None:
        mask = largest(mask & scene.box_mask(box, BOX_MM))
    inner = eroded(mask, 3.0, scene.step)
    spread = float(blurred(scene.filled, 2.0, scene.step)[inner].std()) if inner.any() else np.inf
    return Found(mask, prompts.mode("bladder"), _confidence(scene, mask, spread, seen))


def _drawn(scene: Scene, prompts: Prompts, blocked: Mask) -> tuple[Mask, float] | None:
    """The bladder from its urine, and the share of its surface that a contrast shows; None where no urine is found."""
    smooth = blurred(scene.filled, 2.0, scene.step)
    allowed = _allowed(scene, prompts) & ~blocked
    point = prompts.point("bladder")
    core = best_core(scene, smooth, allowed) if point is None else core_at(scene, smooth, allowed, point)
    if core is None:
        return None
    urine = urine_of(scene, core)
    region = urine_region(scene, urine, smooth, core, allowed)
    if scene.cc(region) < LEAST_CC:
        return None
    shell, seen = _outer(scene, shell_of_mask(region, scene.grid, 1.5), urine.hu)
    mask = largest(filled(shell.voxels(scene.grid)))
    # Noise that looks unlike urine at the wall leaves notches; the wall's outer edge closes them.
    mask = largest(mask_to_edges(scene.soft_tissue, scene.fat_edge, mask, NOTCH_MM))
    depth = depth_of(mask, scene.step)
    return largest(opened(mask, min(BALL_SHARE * depth, BALL_MM), scene.step)), seen


def _with_points(scene: Scene, points: FloatArray, blocked: Mask, mask: Mask | None, seen: float) -> Mask:
    """The drawn bladder held to its six points; the shape within them where none was drawn or it ran away, and half-way to
    that where the picture shows little of the wall."""
    if mask is not None:
        mask = held_to(scene, mask, points)
        if seen >= SEEN_SHARE and misses(scene, mask, points) <= MOST_OFF_MM:
            return mask
    shape = shape_within(scene, points, blocked)
    if mask is None or ran_away(scene, mask, points, shape):
        return held_to(scene, shape, points)
    return between(mask, shape, scene.step)


def _allowed(scene: Scene, prompts: Prompts) -> Mask:
    """Where the bladder may be: above the symphysis' lower edge, in front of the sacrum, not near gas or bone."""
    box = prompts.box("bladder")
    near = scene.body & ~dilated(scene.gas, 3.0, scene.step) & ~scene.bone
    if box is not None:
        return near & scene.box_mask(box, ROOM_MM if "bladder" in prompts.extremes else BOX_MM)
    _, y, z = scene.axes()
    front = scene.pelvis.symphysis
    return near & (z > front[0, 2]) & (y > front[0, 1] - 20.0) & (y < front[1, 1] + 95.0)


def _outer(scene: Scene, shell: Shell, urine: float) -> tuple[Shell, float]:
    """The wall's outer surface, from the urine's, and the share of it that a contrast shows."""
    medium = urine > scene.muscle
    wall, thickest = (MEDIUM_WALL_MM, MEDIUM_THICKEST_MM) if medium else (WALL_MM, THICKEST_MM)
    offsets = np.arange(-INWARD_MM, thickest + 1e-6, STEP_MM)
    sharp = Volume(blurred(scene.hu, 0.8, scene.step), scene.grid.affine)
    values = profiles(sharp, shell.points, shell.normals, offsets)
    start = np.full(len(values), np.searchsorted(offsets, 0.0))
    fat = crossing(values, start, scene.fat_edge, len(offsets))
    against_fat = np.isfinite(fat)
    inside = np.clip((values - scene.fat_edge) / 40.0, -1.0, 1.0)
    # Against soft tissue the wall cannot be told from its neighbour: it ends a little beyond the urine.
    inside[~against_fat] = np.where(offsets < wall, 0.5, -0.5)
    found = optimal_surface(region_cost(inside), shell.edges, 1, STIFFNESS)
    near = crossing(values, found, scene.fat_edge, 2)
    place = np.where(np.isfinite(near), near, found + 0.5)
    move = shell.smoothed(offsets[0] + STEP_MM * place, 4)
    contrast = against_fat | (values[:, -1] > urine + ABOVE_HU) | (medium & (values[:, -1] < urine - ABOVE_HU))
    return shell.moved(shell.points + move[:, None] * shell.normals), float(contrast.mean())


def _confidence(scene: Scene, mask: Mask, spread: float, seen: float) -> float:
    """From size, evenness of the urine and the share of the surface that a contrast shows."""
    cc = scene.cc(mask)
    size = np.clip((cc - SMALLEST_CC) / 25.0, 0.0, 1.0) * np.clip((1500.0 - cc) / 500.0, 0.0, 1.0)
    even = 1.0 / (1.0 + (spread / 9.0) ** 2)
    return round(float(size * even * np.clip((seen - 0.3) / 0.5, 0.0, 1.0)), 3)
