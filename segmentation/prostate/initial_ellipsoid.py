"""Where the prostate lies and about how large it is: an ellipsoid that holds what looks like prostate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray
from palpate.segmentation.methods.extreme_points import POWER, Ellipsoid
from palpate.segmentation.methods.star_surface import ellipsoid_radii, star
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import GAS_HU, Mask

# Semi-axes of a usual prostate, mm: left-right, front-back, up-down; and the sizes tried, as factors.
USUAL_MM = np.array([23.0, 18.5, 20.0])
SIZES = (0.8, 0.9, 1.0, 1.12, 1.25)
SIZE_SD = 0.25
# The prostate's centre against the symphysis: above its middle, behind its back. Spread of each axis.
ABOVE_MM, BEHIND_MM = 7.0, 22.0
PLACE_SD_MM = np.array([4.0, 8.0, 7.0])
CLICK_SD_MM = 3.5
SEARCH_MM, SEARCH_STEP_MM = 16.0, 2.5
PLACE_WEIGHT = 0.12
# Spread of the radii about the ellipsoid, as a share, by what is known.
SPREAD, BOX_SPREAD, POINTS_SPREAD = 0.2, 0.08, 0.12
# Typical HU of the prostate, what it can be, and how much darker than it the edge against thin fat is.
USUAL_HU, HU_RANGE, DARKER_HU = 33.0, (20.0, 70.0), 24.0


@dataclass(frozen=True, eq=False)
class Guess:
    """Centre (3,) mm and radii (642,) mm expected, and how far the radii may be off, as a share."""

    centre: FloatArray
    radii: FloatArray
    semi: FloatArray
    spread: float
    score: float


def first_guess(
    scene: Scene, prompts: Prompts, likeness: Float32Array, ellipsoid: Ellipsoid | None = None
) -> Guess | None:
    """Where to begin: the ellipsoid of six given points, a box, or what is found near a click or near the symphysis."""
    if ellipsoid is not None:
        return Guess(ellipsoid.centre, ellipsoid.radii(), ellipsoid.semi, POINTS_SPREAD, 1.0)
    box = prompts.box("prostate")
    if box is not None:
        centre, half = box.mean(axis=0), 0.5 * (box[1] - box[0])
        return Guess(centre, ellipsoid_radii(half, POWER), half, BOX_SPREAD, 1.0)
    point = prompts.point("prostate")
    if point is not None:
        return _fitted(scene, likeness, np.asarray(point), np.full(3, prompts.spread_mm.get("prostate", CLICK_SD_MM)))
    front = scene.pelvis.symphysis
    y, z = front[1, 1] + BEHIND_MM, 0.5 * (front[0, 2] + front[1, 2]) + ABOVE_MM
    return _fitted(scene, likeness, np.array([scene.pelvis.midline_x(y, z), y, z]), PLACE_SD_MM)


def _fitted(scene: Scene, likeness: Float32Array, at: FloatArray, sd: FloatArray) -> Guess | None:
    """The ellipsoid near a place that holds most of what is like prostate, with the most that is unlike around it."""
    from scipy import signal  # with all of scipy.stats: too slow to import for a command that draws no organ

    i, j, k = scene.index(at)
    reach = int((SEARCH_MM + 1.7 * USUAL_MM.max()) / scene.step)
    take = tuple(slice(max(0, c - reach), c + reach + 1) for c in (i, j, k))
    skip = max(1, int(SEARCH_STEP_MM / scene.step))
    part = ndimage.uniform_filter(likeness[take], skip)[::skip, ::skip, ::skip]
    origin = np.array([t.start for t in take], dtype=float)
    best: Guess | None = None
    for size in SIZES:
        semi = size * USUAL_MM / (scene.step * skip)
        match = signal.fftconvolve(part, _template(semi), mode="same")
        index = np.indices(part.shape).reshape(3, -1).T
        places = scene.grid.to_lps(origin + index * skip)
        off = (places - at) / sd
        score = match.ravel() - PLACE_WEIGHT * (off**2).sum(axis=1) - PLACE_WEIGHT * (np.log(size) / SIZE_SD) ** 2
        score[(np.abs(places - at) > SEARCH_MM).any(axis=1)] = -np.inf
        top = int(score.argmax())
        if best is None or score[top] > best.score:
            best = Guess(
                places[top], ellipsoid_radii(size * USUAL_MM, POWER), size * USUAL_MM, SPREAD, float(score[top])
            )
    return best if best is not None and np.isfinite(best.score) else None


def _template(semi: FloatArray) -> FloatArray:
    """Mean inside an ellipsoid minus half the mean over a shell around it, as a kernel."""
    half = np.ceil(1.35 * semi).astype(int)
    axes = [np.arange(-h, h + 1) for h in half]
    x, y, z = np.meshgrid(*axes, indexing="ij")
    distance = np.sqrt((x / semi[0]) ** 2 + (y / semi[1]) ** 2 + (z / semi[2]) ** 2)
    inner, outer = distance <= 1.0, (distance > 1.0) & (distance <= 1.3)
    return inner / inner.sum() - 0.5 * outer / max(1, outer.sum())


def likeness_of(scene: Scene, smooth: Float32Array, blocked: Mask, typical_hu: float) -> Float32Array:
    """How well voxels look like a prostate of a typical HU: 1 the same or denser, -1 fat, gas and other organs.

    The sign turns well above half-way to fat: the fat planes about a real prostate are too thin to be seen as fat.
    """
    like = np.clip((smooth - typical_hu + DARKER_HU) / DARKER_HU, -1.0, 1.0)
    # Seeds and calcifications are prostate; bone is blocked.
    like[blocked | (scene.hu < GAS_HU) | ~scene.body] = -1.0
    return like.astype(np.float32)


def typical_hu(scene: Scene, smooth: Float32Array, guess: Guess, blocked: Mask) -> float:
    """Median HU of the inner part of a guess, within what prostates can have."""
    core = star(guess.centre, 0.6 * guess.radii).voxels(scene.grid) & ~blocked
    known = smooth[core]
    known = known[known > scene.fat_edge]
    return float(np.clip(np.median(known), *HU_RANGE)) if len(known) else USUAL_HU


def valleys_of(scene: Scene, smooth: Float32Array) -> Float32Array:
    """Depth in HU, to 20, of thin dark lines in soft tissue: fat planes too thin to be seen as fat."""
    cut = np.clip(smooth, scene.fat_edge, 60.0)
    width = 2 * max(1, round(2.5 / scene.step)) + 1
    return np.clip(ndimage.grey_closing(cut, size=(width,) * 3) - cut, 0.0, 20.0).astype(np.float32)
