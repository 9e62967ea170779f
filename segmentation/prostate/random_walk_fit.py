"""The prostate within its six outermost points, by random walks with the points' ellipsoid as prior."""

from __future__ import annotations

import numpy as np
from scipy.special import expit

from palpate.core.arrays import Float32Array, FloatArray
from palpate.core.statistics import rms
from palpate.segmentation.methods.extreme_points import Ellipsoid
from palpate.segmentation.methods.random_walker import walk
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import Mask, blurred, dilated, eroded, filled, largest, opened

# The surface lies about this far from the ellipsoid, mm; and an organ this much darker than its middle is none any more.
SHAPE_MM, DARKER_HU, SOFTNESS_HU = 3.0, 24.0, 5.0
# An edge, against the differences of neighbours in the middle of the organ; the prior's pull (see random_walk.py).
EDGE_SD, PULL = 2.0, 0.5
# What is certainly inside (level of the ellipsoid), what certainly is not, and how far beyond the points it may reach.
CORE_LEVEL, OUTER_LEVEL, BOX_MM, ROOM_MM = 0.4, 1.8, 1.5, 10.0
SMOOTH_MM = 2.0
# Balls of the first size, so deep behind each given point (along the axis that it is outermost on), are organ: room for
# points that are set a few mm off.
POINT_MM, DEEP_MM = 3.0, 3.5
# A bladder's trunk, wider than a urethra that resection has opened, holds a ball of the first size; it is sure but for its
# wall and what a drawing may be off, the second.
TRUNK_MM, RIM_MM = 8.0, 4.0


def walked(
    scene: Scene, ellipsoid: Ellipsoid, points: FloatArray, blocked: Mask, typical_hu: float
) -> tuple[Mask, FloatArray]:
    """The organ, and for every voxel the probability of belonging to it.

    points : the six outermost ones (6, 3) mm. blocked : other organs and bone.
    """
    box = np.array([points.min(axis=0), points.max(axis=0)])
    near = scene.part(box, ROOM_MM)
    fine = blurred(scene.filled[near], 1.0, scene.step)
    level = ellipsoid.level(scene.axes())[near]
    beyond = np.linalg.norm(_away(scene, ellipsoid.centre)[near], axis=-1) * (1.0 - 1.0 / np.maximum(level, 1e-3))
    prior = expit(-beyond / SHAPE_MM) * expit((fine - typical_hu + DARKER_HU) / SOFTNESS_HU)
    free = ~blocked[near]
    core = (level < CORE_LEVEL) & (fine > typical_hu - 30.0) & free
    outside = (
        ~free | ~scene.box_mask(box, BOX_MM)[near] | (fine < scene.fat_edge) | (level > OUTER_LEVEL) | scene.gas[near]
    )
    probability = np.zeros(scene.grid.array.shape)
    inside = core | (_behind(scene, points)[near] & ~outside)
    probability[near] = walk(fine, inside, outside, _edge(fine, core), prior, PULL)
    mask = largest(opened(largest(probability > 0.5), SMOOTH_MM, scene.step))
    return filled(mask), probability


def _behind(scene: Scene, points: FloatArray) -> Mask:
    """Balls just inside of the six points: an organ's surface is square to the axis along which a point is outermost."""
    found = np.zeros(scene.grid.array.shape, dtype=bool)
    for axis in range(3):
        for point, inward in ((points[points[:, axis].argmin()], 1.0), (points[points[:, axis].argmax()], -1.0)):
            centre = point + inward * DEEP_MM * np.eye(3)[axis]
            found |= sum((x - c) ** 2 for x, c in zip(scene.axes(), centre, strict=True)) < POINT_MM**2
    return found


def block(scene: Scene, others: Mask) -> Mask:
    """Where the organ cannot be: other organs, and bone with the cortex that partial volume hides."""
    return others | dilated(scene.bone, 1.0, scene.step)


def deep_in(others: Mask, step: float) -> Mask:
    """The inside of the large parts of other organs: what no one's extreme points make part of this one."""
    return dilated(eroded(others, TRUNK_MM, step), TRUNK_MM - RIM_MM, step)


def _away(scene: Scene, centre: FloatArray) -> FloatArray:
    return np.stack(np.broadcast_arrays(*scene.axes()), axis=-1) - centre


def _edge(fine: Float32Array, core: Mask) -> float:
    steps = [np.diff(fine, axis=axis)[core.take(range(1, core.shape[axis]), axis=axis)] for axis in range(3)]
    known = np.concatenate(steps)
    return max(EDGE_SD * rms(known), 0.5) if len(known) else 10.0
