"""The prostate: an ellipsoid between bladder, rectum and symphysis that is drawn out to the edges that CT shows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy import ndimage

from palpate.core.arrays import Float32Array, FloatArray
from palpate.segmentation.methods.extreme_points import POWER, ellipsoid_of
from palpate.segmentation.methods.optimal_surface import fall, optimal_surface, region_cost
from palpate.segmentation.methods.star_surface import ellipsoid_radii, sphere, star
from palpate.segmentation.methods.subvoxel_edges import moved_to_edges
from palpate.segmentation.methods.surface_mesh import Shell, shell_of_mask
from palpate.segmentation.points_fit import between, ran_away, shape_within
from palpate.segmentation.prompts import Prompts
from palpate.segmentation.prostate.initial_ellipsoid import (
    USUAL_HU,
    Guess,
    first_guess,
    likeness_of,
    typical_hu,
    valleys_of,
)
from palpate.segmentation.prostate.random_walk_fit import block, deep_in, walked
from palpate.segmentation.search_region import Found, Scene
from palpate.segmentation.working_grid import Mask, blurred, largest

# Samples along rays, as shares of the expected radius.
SHARES = np.arange(0.3, 1.75, 0.025)
# Soft tissue is weak evidence, since muscle looks the same; edges and, less, thin dark lines speak for a boundary.
SOFT_WEIGHT, PRIOR_WEIGHT, VALLEY_WEIGHT, STIFFNESS = 0.05, 0.8, 0.1, 0.2
EDGE_WEIGHT, CORE_SHARE = 3.0, 0.75
# Rounds of drawing, how much of what was drawn goes into the next round's shape, and how far a last edge may be.
ROUNDS, LEARNT, SNAP_MM = 4, 0.6, 2.5
# What other organs and bone leave of less is no prostate.
LEAST_CC = 2.0
# No grown man's prostate is smaller.
SMALLEST_CC = 10.0
# Within this level of the ellipsoid of six given points other organs do not count, but for what is deep in a large one.
SURE_LEVEL = 0.9


def find_prostate(scene: Scene, prompts: Prompts, bladder: Mask | None, rectum: Mask | None) -> Found | None:
    """The prostate; None where nothing like it is there."""
    others = np.zeros(scene.grid.array.shape, dtype=bool)
    for mask in (bladder, rectum):
        if mask is not None:
            others |= mask
    points = prompts.extremes.get("prostate")
    ellipsoid = None if points is None else ellipsoid_of(points)
    if ellipsoid is not None:
        # Who gives its outermost points says that what they surround is prostate, whatever was found there.
        others &= (ellipsoid.level(scene.axes()) > SURE_LEVEL) | deep_in(others, scene.step)
    blocked = block(scene, others)
    smooth = blurred(scene.filled, 1.0, scene.step)
    guess = first_guess(scene, prompts, likeness_of(scene, smooth, blocked, USUAL_HU), ellipsoid)
    if guess is None:
        return None
    valleys = valleys_of(scene, smooth)
    for number in range(ROUNDS):
        likeness = likeness_of(scene, smooth, blocked, typical_hu(scene, smooth, guess, blocked))
        shell, seen = _drawn(scene, guess, likeness, valleys, prompts)
        guess = _again(guess, shell, prompts, number == ROUNDS - 2)
    free = shell.voxels(scene.grid) & ~blocked
    if prompts.mode("prostate") == "click" and others.any() and scene.cc(free) < SMALLEST_CC:
        # Who clicks says that a prostate is there: what leaves it less room than any has is wrong itself.
        return find_prostate(scene, prompts, None, None)
    if scene.cc(free) < LEAST_CC:
        shape = None if points is None else shape_within(scene, points, blocked)
        return None if shape is None or not shape.any() else Found(shape, "extremes", 0.0)
    shell = shell_of_mask(free, scene.grid, 1.0)
    shell, _ = moved_to_edges(scene.soft_tissue, scene.fat_edge, shell, SNAP_MM)
    mask = largest(shell.voxels(scene.grid) & ~blocked)
    box = prompts.box("prostate")
    if ellipsoid is not None and points is not None:
        typical = typical_hu(scene, smooth, guess, blocked)
        again, _ = walked(scene, ellipsoid, points, blocked, typical)
        mask = between(mask, again, scene.step) if again.any() else mask
        shape = shape_within(scene, points, blocked)
        mask = shape if ran_away(scene, mask, points, shape) else mask
    if box is not None:
        mask = largest(mask & scene.box_mask(box, 1.0))
    return Found(mask, prompts.mode("prostate"), _confidence(scene, mask, guess, seen, bladder, rectum))


def _again(guess: Guess, shell: Shell, prompts: Prompts, last: bool) -> Guess:
    """The guess moved to what has been drawn, for another round; the last round starts from the drawn shape itself."""
    if last:
        radii = np.linalg.norm(shell.points - guess.centre, axis=1)
        return replace(guess, radii=radii, spread=0.5 * guess.spread)
    if prompts.box("prostate") is not None:
        return guess
    a, b, c = (shell.points[shell.faces[:, i]] for i in range(3))
    volume = np.einsum("ij,ij->i", a - guess.centre, np.cross(b - guess.centre, c - guess.centre))
    centre = guess.centre + (volume[:, None] * (a + b + c - 3.0 * guess.centre) / 4.0).sum(axis=0) / volume.sum()
    semi = np.array([np.abs(shell.points[:, i] - centre[i]).max() for i in range(3)])
    semi = LEARNT * np.clip(semi, 12.0, 40.0) + (1.0 - LEARNT) * guess.semi
    return replace(guess, centre=centre, radii=ellipsoid_radii(semi, POWER), semi=semi)


def _drawn(
    scene: Scene, guess: Guess, likeness: Float32Array, valleys: Float32Array, prompts: Prompts
) -> tuple[Shell, float]:
    """The surface that agrees best with picture and shape, and the share of it where the picture speaks."""
    rays = guess.radii[:, None] * SHARES[None, :]
    points = guess.centre + rays[:, :, None] * sphere().points[:, None, :]
    index = scene.grid.to_index(points.reshape(-1, 3)).T
    values = ndimage.map_coordinates(likeness, index, order=1, mode="nearest").reshape(rays.shape)
    # A urethra widened by resection is as dark as urine: what is dark within the core is no edge.
    values[:, SHARES < CORE_SHARE] = np.maximum(values[:, SHARES < CORE_SHARE], 0.5)
    depth = ndimage.map_coordinates(valleys, index, order=1, mode="nearest").reshape(rays.shape)
    inside = np.where(values > 0.0, SOFT_WEIGHT * values, values)
    # Fat between organ and another organ ends the organ: what lies behind it does not count again.
    ended = np.cumsum(values < -0.5, axis=1) > 2
    inside = np.where(ended, np.minimum(inside, -0.3), inside)
    prior = 0.5 * ((SHARES[None, :] - 1.0) / guess.spread) ** 2 * np.ones((len(rays), 1))
    cost = (
        region_cost(inside)
        + PRIOR_WEIGHT * prior
        - VALLEY_WEIGHT * depth
        - EDGE_WEIGHT * fall(values)
        + _held(guess, rays, prompts)
    )
    found = optimal_surface(cost, sphere().edges, 3, STIFFNESS)
    radii = np.take_along_axis(rays, found[:, None], axis=1)[:, 0]
    seen = np.take_along_axis(values, np.minimum(found + 3, len(SHARES) - 1)[:, None], axis=1)[:, 0] < 0.0
    radii = sphere().smoothed(radii, 3)
    return star(guess.centre, radii), float(seen.mean())


def _held(guess: Guess, rays: FloatArray, prompts: Prompts) -> FloatArray:
    """Cost that holds the surface to the extreme points a person gave."""
    cost = np.zeros_like(rays)
    for point in prompts.extremes.get("prostate", np.empty((0, 3))):
        away = point - guess.centre
        radius = float(np.linalg.norm(away))
        near = sphere().points @ (away / radius)
        weight = np.clip((near - 0.94) / 0.06, 0.0, 1.0)
        cost += weight[:, None] * (np.abs(rays - radius) / 1.0)
    return cost


def _confidence(
    scene: Scene, mask: Mask, guess: Guess, seen: float, bladder: Mask | None, rectum: Mask | None
) -> float:
    """From size, the fit of the ellipsoid, the share of the surface that the picture shows, and known neighbours."""
    size = np.exp(-0.5 * (np.log(max(scene.cc(mask), 1.0) / 42.0) / 0.6) ** 2)
    neighbours = (0.75 if bladder is None else 1.0) * (0.75 if rectum is None else 1.0)
    fit = np.clip(guess.score / 0.8, 0.0, 1.0)
    return round(float(size * neighbours * fit * np.clip((seen - 0.15) / 0.5, 0.0, 1.0)), 3)
