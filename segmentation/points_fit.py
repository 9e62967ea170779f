"""What six outermost points of an organ allow, whatever the picture shows: a shape within them, and surfaces held to them."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.special import expit

from palpate.core.arrays import Float32Array, FloatArray
from palpate.core.statistics import rms
from palpate.segmentation.methods.extreme_points import Ellipsoid, ellipsoid_of
from palpate.segmentation.methods.random_walker import walk
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import (
    Mask,
    blurred,
    box_around,
    distance_of,
    distance_to,
    filled,
    largest,
    opened,
    signed_distance,
)

# Levels of the ellipsoid within which all is organ, within which the organ's look is learnt, and beyond which nothing is it.
SURE_LEVEL, LEARNT_LEVEL, OUTER_LEVEL = 0.4, 0.6, 1.8
# From so far outside of the ellipsoid on, and as far beyond the points, the look of the surroundings is learnt, mm.
OUTSIDE_MM, ROOM_MM = 4.0, 12.0
# The surface lies about this far from the ellipsoid, mm. The picture speaks no louder than this, in units of ln odds.
SHAPE_MM, LOUDEST = 3.0, 2.5
# A person's points are this exact, mm; differences of neighbours that are edges, against those within; the prior's pull.
POINT_MM, EDGE_SD, LEAST_EDGE_HU, PULL = 1.5, 2.0, 0.5, 0.5
SMOOTH_MM, BLUR_MM, BINS = 2.0, 1.0, 40
# A surface that misses points by more (mm rms, the worst one left out), or shares less with the shape within the points (Dice), ran away.
MOST_OFF_MM, LEAST_SHARED = 6.0, 0.7
# The middle of six points (level of the ellipsoid), and so much about a click, mm, is no other organ.
CLAIMED_LEVEL, CLAIMED_MM = 0.5, 8.0
# Walls that a picture does not tell are no thicker, mm.
MOST_MOVE_MM = 8.0


def shape_within(scene: Scene, points: FloatArray, taken: Mask) -> Mask:
    """The organ within six outermost points (6, 3) mm: their ellipsoid, corrected where the picture inside differs from that outside.

    Nothing is asked of HU but that they tell the middle of the ellipsoid from what surrounds it. taken : where others are.
    """
    ellipsoid = ellipsoid_of(points)
    box = np.array([points.min(axis=0), points.max(axis=0)])
    near = scene.part(box, ROOM_MM)
    picture = blurred(scene.filled[near], BLUR_MM, scene.step)
    level, beyond = _level(scene, ellipsoid, near)
    core = level < LEARNT_LEVEL
    around = (beyond > OUTSIDE_MM) & scene.body[near]
    prior = expit(-beyond / SHAPE_MM + np.clip(_log_odds(picture, core, around), -LOUDEST, LOUDEST))
    inside = (level < SURE_LEVEL) & ~taken[near]
    outside = ~scene.box_mask(box, POINT_MM)[near] | (level > OUTER_LEVEL) | taken[near]
    found = walk(picture, inside, outside, _edge(picture, core), prior, PULL) > 0.5
    mask = np.zeros(scene.grid.array.shape, dtype=bool)
    mask[near] = filled(largest(opened(largest(found), SMOOTH_MM, scene.step)))
    return mask


def claim_of(scene: Scene, prompts: Prompts, organ: str) -> Mask:
    """What a person's points make this organ's own, whatever is found there: the middle of six points, or a ball about a click."""
    claim = np.zeros(scene.grid.array.shape, dtype=bool)
    mode = prompts.mode(organ)
    if mode == "extremes":
        points = prompts.extremes[organ]
        near = scene.part(np.array([points.min(axis=0), points.max(axis=0)]), ROOM_MM)
        claim[near] = _level(scene, ellipsoid_of(points), near)[0] < CLAIMED_LEVEL
    elif mode == "click":
        away = sum((x - c) ** 2 for x, c in zip(scene.axes(), prompts.seeds[organ], strict=True))
        claim |= away < CLAIMED_MM**2
    return claim


def misses(scene: Scene, mask: Mask, points: FloatArray) -> float:
    """By how much a surface misses six points, mm rms, the worst one left out."""
    return rms(np.sort(np.abs(distance_of(points, mask, scene.grid)))[:-1])


def ran_away(scene: Scene, mask: Mask, points: FloatArray, shape: Mask) -> bool:
    """Whether a surface misses the points, or leaves the shape within them, by more than the picture may make it."""
    shared = 2.0 * int((mask & shape).sum()) / max(1, int(mask.sum()) + int(shape.sum()))
    return bool(misses(scene, mask, points) > MOST_OFF_MM or shared < LEAST_SHARED)


def between(first: Mask, second: Mask, step: float) -> Mask:
    """The mask half-way between two: two ways of drawing err in different places."""
    near = box_around(first | second, 3.0)
    middle = sum(_signed(mask[near]) for mask in (first, second))
    found = np.zeros(first.shape, dtype=bool)
    found[near] = largest(blurred(np.asarray(middle, dtype=np.float32), 1.0, step) > 0.0)
    return found


def held_to(scene: Scene, mask: Mask, points: FloatArray) -> Mask:
    """The mask grown, or shrunk, evenly until six points (6, 3) mm but one lie on it or on its other side: a wall that the picture
    does not show is missing on all sides alike, and what looks like the wall and lies about it is too much on all sides."""
    distance = signed_distance(mask, scene.grid)
    away = np.sort(distance.at(points))
    move = float(np.clip(max(away[1], 0.0) + min(away[-2], 0.0), -MOST_MOVE_MM, MOST_MOVE_MM))
    return mask if abs(move) <= 0.5 * scene.step else largest(distance.array < move)


def _level(scene: Scene, ellipsoid: Ellipsoid, near: tuple[slice, ...]) -> tuple[FloatArray, FloatArray]:
    """Level of the ellipsoid, and mm beyond its surface along the ray from its centre, in a part of the grid."""
    x, y, z = scene.axes()
    axes = x[near[0]], y[:, near[1]], z[:, :, near[2]]
    level = ellipsoid.level(axes)
    radius = np.linalg.norm(np.stack(np.broadcast_arrays(*axes), axis=-1) - ellipsoid.centre, axis=-1)
    return level, radius * (1.0 - 1.0 / np.maximum(level, 1e-3))


def _log_odds(picture: Float32Array, inside: Mask, outside: Mask) -> FloatArray:
    """ln of how much more often each voxel's HU is met inside than outside."""
    if not (inside.any() and outside.any()):
        return np.zeros(picture.shape)
    low, high = np.percentile(picture[inside | outside], [0.5, 99.5])
    if high - low < 1.0:
        return np.zeros(picture.shape)
    bins = np.clip((picture - low) / (high - low) * BINS, 0, BINS - 1).astype(int)
    shares = []
    for mask in (inside, outside):
        count = ndimage.gaussian_filter1d(np.bincount(bins[mask], minlength=BINS).astype(float), 1.0)
        shares.append(count / count.sum())
    least = 0.01 * max(float(share.max()) for share in shares)
    ratio = np.log((shares[0] + least) / (shares[1] + least))
    return np.asarray(ratio[bins])


def _edge(picture: Float32Array, core: Mask) -> float:
    steps = [np.diff(picture, axis=axis)[core.take(range(1, core.shape[axis]), axis=axis)] for axis in range(3)]
    known = np.concatenate(steps)
    return max(EDGE_SD * rms(known), LEAST_EDGE_HU) if len(known) else 10.0


def _signed(mask: Mask) -> FloatArray:
    return distance_to(~mask, 1.0) - distance_to(mask, 1.0)
