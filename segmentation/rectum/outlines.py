"""Outlines of the rectum, one a slice, as radii about a middle; and what the picture says along these rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import FloatArray
from palpate.segmentation.methods.optimal_surface import fall
from palpate.segmentation.search_region import Scene
from palpate.segmentation.working_grid import GAS_HU

ANGLES = 48
RADII = np.arange(2.0, 36.0, 0.75)
RADIUS_STEP = 0.75
# Wall between gas and what is around, as it is usually met.
WALL_MM = 3.5
USUAL_MM = 13.0
# How far below and above the symphysis the rectum is sought.
BELOW_MM, ABOVE_MM = 20.0, 72.0
# Evidence of soft tissue is weak, since levator and prostate look the same; that of fat and gas is strong.
SOFT_WEIGHT = 0.05
EDGE_WEIGHT = 1.5
_THETA = 2.0 * np.pi * np.arange(ANGLES) / ANGLES
UNIT = np.column_stack([np.cos(_THETA), np.sin(_THETA)])


@dataclass(frozen=True, eq=False)
class Track:
    """Heights z (s,) mm rising, centres (s, 2) mm and radii (s, ANGLES) mm of the outline."""

    z: FloatArray
    centres: FloatArray
    radii: FloatArray


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


def centroid(points: FloatArray) -> FloatArray:
    """Centre of area (2,) of a polygon (n, 2)."""
    after = np.roll(points, -1, axis=0)
    cross = points[:, 0] * after[:, 1] - after[:, 0] * points[:, 1]
    return ((points + after) * cross[:, None]).sum(axis=0) / (3.0 * cross.sum())


def about(points: FloatArray, centre: FloatArray) -> FloatArray:
    """Radii (ANGLES,) of a polygon (n, 2) as seen from a centre."""
    away = points - centre
    angle = np.mod(np.arctan2(away[:, 1], away[:, 0]), 2.0 * np.pi)
    return np.interp(_THETA, angle[order := np.argsort(angle)], np.hypot(*away[order].T), period=2.0 * np.pi)
