"""Following the rectum from slice to slice: where to begin, and its outline around a moving centre."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.measure import label, regionprops

from palpate.core.arrays import Float32Array, FloatArray
from palpate.segmentation.methods.optimal_surface import fall, optimal_surface, region_cost
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import GAS_HU, Mask, opened

ANGLES = 48
RADII = np.arange(2.0, 36.0, 0.75)
RADIUS_STEP = 0.75
# Wall between gas and what is around, as it is usually met.
WALL_MM = 3.5
# The centre of the rectum lies about this far behind the symphysis.
BEHIND_MM, BEHIND_SD_MM = 62.0, 18.0
BESIDE_SD_MM = 12.0
USUAL_MM = 13.0
# A section of gas this large in the usual place is the rectum's; the least that is begun with, as a share of that.
GAS_MM2, LEAST_GAS = 200.0, 0.05
# The centre moves no further from one slice to the next, but where folds reach into the lumen it does move.
JUMP_MM, BESIDE_MM = 9.0, 22.0
AREA_MM2 = (250.0, 2800.0)
# How far below and above the symphysis the rectum is followed.
BELOW_MM, ABOVE_MM = 20.0, 72.0
# Evidence of soft tissue is weak, since levator and prostate look the same; that of fat and gas is strong.
SOFT_WEIGHT, PRIOR_WEIGHT, STIFFNESS = 0.05, 0.08, 0.35
EDGE_WEIGHT = 1.5
_THETA = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
RING = np.column_stack([np.arange(ANGLES), (np.arange(ANGLES) + 1) % ANGLES])
UNIT = np.column_stack([np.cos(_THETA), np.sin(_THETA)])


@dataclass(frozen=True, eq=False)
class Track:
    """Heights z (s,) mm rising, centres (s, 2) mm and radii (s, ANGLES) mm of the outline."""

    z: FloatArray
    centres: FloatArray
    radii: FloatArray


def start_of(scene: Scene, avoid: Mask) -> FloatArray | None:
    """A point (3,) mm in the rectum: the middle of the roundest piece that fat bounds where rectums are, or of its gas where
    that lies as well."""
    best, best_score = None, 0.0
    for z in _heights(scene):
        for at, area, solidity in _pieces(scene, avoid, z):
            score = solidity**4 * _usual_place(scene, at, z) * min(area, 500.0) / 500.0
            if score > best_score:
                best, best_score = np.array([*at, z]), float(score)
    gas, gas_score = _gas_start(scene)
    return gas if gas_score > best_score else best


def _heights(scene: Scene) -> FloatArray:
    """Heights at which a rectum is begun with, mm: about the upper half of the symphysis and above."""
    front = scene.pelvis.symphysis
    return np.arange(front.mean(axis=0)[2], front[1, 2] + 40.0, 2.5)


def _usual_place(scene: Scene, at: FloatArray, z: float) -> float:
    """1 where the rectum's centre is usually met at a height, less away from it."""
    beside = (at[0] - scene.pelvis.midline_x(at[1], z)) / BESIDE_SD_MM
    behind = (at[1] - scene.pelvis.symphysis[1, 1] - BEHIND_MM) / BEHIND_SD_MM
    return float(np.exp(-0.5 * (beside**2 + behind**2)))


def _gas_start(scene: Scene) -> tuple[FloatArray | None, float]:
    """The middle (3,) mm of the section of gas that lies most where rectums are, and how well, 0 to 1; None where there is
    no such gas."""
    best, best_score = None, LEAST_GAS
    for z in _heights(scene):
        k = scene.index(np.array([0.0, 0.0, z]))[2]
        for part in regionprops(label(scene.gas[:, :, k])):
            at = scene.grid.to_lps(np.array([[*part.centroid, k]]))[0, :2]
            area = part.area * scene.step**2
            score = _usual_place(scene, at, z) * min(area, GAS_MM2) / GAS_MM2
            if score > best_score:
                best, best_score = np.array([*at, z]), float(score)
    return best, best_score if best is not None else 0.0


def _pieces(scene: Scene, avoid: Mask, z: float) -> list[tuple[FloatArray, float, float]]:
    """Pieces of soft tissue or gas at a height: centre (2,) mm, area mm2, solidity."""
    k = scene.index(np.array([0.0, 0.0, z]))[2]
    soft = (scene.filled[:, :, k] > scene.fat_edge) & ~avoid[:, :, k] & scene.body[:, :, k]
    parts = regionprops(label(opened(soft, 3.0, scene.step)))
    found = [(np.array([*part.centroid, k]), part.area * scene.step**2, float(part.solidity)) for part in parts]
    return [(scene.grid.to_lps(at[None])[0, :2], area, s) for at, area, s in found if AREA_MM2[0] < area < AREA_MM2[1]]


def follow(scene: Scene, avoid: Mask, start: FloatArray, ends: tuple[float, float]) -> Track:
    """The outline in every second slice, up and down from ``start`` (3,) mm to the heights ``ends`` mm."""
    first = _outline(scene, avoid, start, np.full(ANGLES, USUAL_MM), 0.3)
    found = {float(start[2]): first}
    for direction in (1.0, -1.0):
        z, last = float(start[2]), first
        while ends[0] <= z + direction * 2.0 * scene.step <= ends[1]:
            z += direction * 2.0 * scene.step
            after = _next(scene, avoid, z, last)
            if after is None:
                break
            last = found[z] = after
    heights = np.array(sorted(found))
    return Track(heights, np.array([found[z][0] for z in heights]), np.array([found[z][1] for z in heights]))


def _next(
    scene: Scene, avoid: Mask, z: float, last: tuple[FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray] | None:
    """The outline at height z from the one before; None where the rectum is lost."""
    centre, radii = last
    after = _outline(scene, avoid, np.array([*centre, z]), _rounder(radii), 1.0)
    if _follows(after, centre):
        return after
    # Folds end a lumen abruptly: it goes on in the nearest piece beside.
    near = [(np.hypot(*(at - centre)), at, area) for at, area, _ in _pieces(scene, avoid, z)]
    if not near:
        return None
    far, at, area = min(near, key=lambda piece: piece[0])
    again = _outline(scene, avoid, np.array([*at, z]), np.full(ANGLES, np.sqrt(area / np.pi)), 0.3)
    return again if far < BESIDE_MM and _follows(again, at) else None


def _follows(outline: tuple[FloatArray, FloatArray], centre: FloatArray) -> bool:
    area = float(np.pi * np.mean(outline[1] ** 2))
    return bool(np.hypot(*(outline[0] - centre)) < JUMP_MM and 0.3 * AREA_MM2[0] < area < AREA_MM2[1])


def evidence(
    values: FloatArray, raw: FloatArray, blocked: FloatArray, fat_edge: float
) -> tuple[FloatArray, FloatArray]:
    """How well samples (n, m) along rays belong to the rectum, and the radius (n,) mm gas foretells; 0 without gas.

    values : HU with gas as soft tissue. raw : HU. blocked : 1 in other organs.
    """
    soft = np.clip((values - fat_edge) / 40.0, -1.0, 1.0)
    inside = np.where(soft > 0.0, SOFT_WEIGHT * soft, soft)
    gas = raw < GAS_HU
    # Gas that is reached only through fat belongs to another loop.
    reached = np.cumsum((values < fat_edge - 20.0) | (blocked > 0.5), axis=1) == 0
    gas &= reached
    last = np.where(gas.any(axis=1), gas.shape[1] - 1 - gas[:, ::-1].argmax(axis=1), -1)
    sample = np.arange(values.shape[1])
    within = sample[None, :] <= last[:, None]
    inside = np.where(within, 1.0, inside)
    inside = np.where(blocked > 0.5, -1.0, inside)
    return inside, np.where(last >= 0, RADII[np.maximum(last, 0)] + WALL_MM, 0.0)


def soft_edge(values: FloatArray, scene: Scene) -> FloatArray:
    """How much of an edge from soft tissue to fat each sample (n, m) along rays is, 0 to 1."""
    return fall(np.clip((values - scene.fat_edge) / 40.0, -1.0, 1.0))


def prior_cost(expected: FloatArray, weight: float) -> FloatArray:
    """Cost (n, m) of radii that differ from the expected ones (n,) mm."""
    return weight * ((RADII[None, :] - expected[:, None]) / RADIUS_STEP) ** 2


def sampled(scene: Scene, array: NDArray[np.floating], centres: FloatArray, z: FloatArray) -> FloatArray:
    """Values (n, m) of an array along rays from centres (n / ANGLES, 2) mm at heights z."""
    plane = centres[:, None, None, :] + RADII[None, None, :, None] * UNIT[None, :, None, :]
    points = np.concatenate([plane, np.broadcast_to(z[:, None, None, None], (*plane.shape[:3], 1))], axis=3)
    index = scene.grid.to_index(points.reshape(-1, 3)).T
    values = ndimage.map_coordinates(array, index, order=1, mode="nearest")
    return np.asarray(values, dtype=np.float64).reshape(-1, len(RADII))


def _outline(
    scene: Scene, avoid: Mask, at: FloatArray, expected: FloatArray, trust: float
) -> tuple[FloatArray, FloatArray]:
    """Centre (2,) and radii (ANGLES,) of the outline in one slice, seen again from its own centre."""
    centre = at[:2]
    for _ in range(2):
        section = [sampled(scene, array, centre[None], at[2:3]) for array in _pictures(scene, avoid)]
        inside, gas_radius = evidence(section[0], section[1], section[2], scene.fat_edge)
        hoped = np.maximum(expected, gas_radius)
        cost = (
            region_cost(inside) + prior_cost(hoped, PRIOR_WEIGHT * trust) - EDGE_WEIGHT * soft_edge(section[0], scene)
        )
        radii = RADII[optimal_surface(cost, RING, 2, STIFFNESS)]
        points = centre + radii[:, None] * UNIT
        moved = _centroid(points)
        expected = about(points, moved)
        centre = moved
    return centre, expected


def _pictures(scene: Scene, avoid: Mask) -> tuple[Float32Array, ...]:
    return scene.filled, scene.hu, avoid.astype(np.float32)


def _centroid(points: FloatArray) -> FloatArray:
    """Centre of area (2,) of a polygon (n, 2)."""
    after = np.roll(points, -1, axis=0)
    cross = points[:, 0] * after[:, 1] - after[:, 0] * points[:, 1]
    return ((points + after) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())


def about(points: FloatArray, centre: FloatArray) -> FloatArray:
    """Radii (ANGLES,) of a polygon (n, 2) as seen from a centre."""
    away = points - centre
    angle = np.mod(np.arctan2(away[:, 1], away[:, 0]), 2.0 * np.pi)
    return np.interp(_THETA, angle[order := np.argsort(angle)], np.hypot(*away[order].T), period=2.0 * np.pi)


def _rounder(radii: FloatArray) -> FloatArray:
    """The outline expected in the next slice: the same, a little nearer a circle, so that leaks do not travel."""
    smooth = np.mean([np.roll(radii, s) for s in (-2, -1, 0, 1, 2)], axis=0)
    mean = float(np.median(radii))
    return np.clip(0.8 * smooth + 0.2 * USUAL_MM, 0.6 * mean, 1.4 * mean)
