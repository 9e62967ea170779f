"""From a specification and labels at rest to moved walls of rectum and bladder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.interpolate import UnivariateSpline
from scipy.optimize import brentq

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import BLADDER, LABELS, ORGAN_LABELS, OUTSIDE, RECTUM
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import wall_surface
from palpate.simulate.wall_motion import BagMotion, Faded, MovedWall, TubeMotion


@dataclass(frozen=True)
class RectumSpec:
    """inflate_mm, bias, push_mm, half_length_mm as in `TubeMotion`; middle_mm : height over the organ's centroid."""

    inflate_mm: float = 9.0
    bias: tuple[float, float] = (0.0, 0.0)
    push_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    middle_mm: float = 0.0
    half_length_mm: float = 36.0


@dataclass(frozen=True)
class BladderSpec:
    """volume_change_cc : what it takes in (negative: gives off); None for ``balance`` times what the rectum takes in, given off."""

    volume_change_cc: float | None = None
    balance: float = 0.9
    push_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


def moved_walls(labels: Volume, rectum: RectumSpec | None, bladder: BladderSpec | None) -> dict[str, MovedWall]:
    """The walls that the specification names, "rectum" and "bladder".

    labels : the modelled region, 0 outside. Raises InputError when the label is not there or the bladder cannot give
    off that much.
    """
    depth = region_depth(labels)
    walls: dict[str, MovedWall] = {}
    if rectum is not None:
        surface = _wall(labels, RECTUM, depth)
        walls["rectum"] = MovedWall(surface, Faded(_tube(labels, rectum), depth))
    if bladder is not None:
        surface, wanted = _wall(labels, BLADDER, depth), bladder.volume_change_cc
        taken_in = walls["rectum"].volume_change if "rectum" in walls else 0.0
        change = -bladder.balance * taken_in if wanted is None else 1000.0 * wanted
        walls["bladder"] = MovedWall(surface, _bag(labels, surface, bladder, change, depth))
    return walls


def region_depth(labels: Volume) -> Volume:
    """Distance (float32 volume) mm of every voxel from the outside of the modelled region; the grid's rim counts as outside."""
    inside = np.pad(labels.array != OUTSIDE, 1)
    depth = ndimage.distance_transform_edt(inside, sampling=labels.spacing)[1:-1, 1:-1, 1:-1]
    return labels.with_array(depth.astype(np.float32))


def _tube(labels: Volume, spec: RectumSpec) -> TubeMotion:
    organ = labels.to_lps(np.argwhere(np.isin(labels.array, ORGAN_LABELS)).astype(float)).mean(axis=0)
    centre = centre_line(labels, RECTUM)
    middle = float(organ[2]) + spec.middle_mm
    return TubeMotion(centre, spec.inflate_mm, np.array(spec.bias), np.array(spec.push_mm), middle, spec.half_length_mm)


def centre_line(labels: Volume, label: int) -> Callable[[FloatArray], FloatArray]:
    """Centres x, y (n, 2) mm of a tube's axial sections at heights z (n,), smoothed along z; constant beyond its ends."""
    _require(labels, label)
    points = labels.to_lps(np.argwhere(labels.array == label).astype(float))
    heights, row = np.unique(np.round(points[:, 2], 3), return_inverse=True)
    counts = np.bincount(row)
    curves = []
    for axis in (0, 1):
        centres = np.bincount(row, points[:, axis]) / counts
        # About 0.5 mm of roughness is the voxels', not the organ's.
        curves.append(UnivariateSpline(heights, centres, k=min(3, len(heights) - 1), s=0.25 * len(heights)))
    return lambda z: np.column_stack([c(np.clip(z, heights[0], heights[-1])) for c in curves])


def _bag(labels: Volume, wall: Surface, spec: BladderSpec, change: float, depth: Volume) -> Faded:
    points = labels.to_lps(np.argwhere(labels.array == BLADDER).astype(float))
    low = points[points[:, 2] < np.quantile(points[:, 2], 0.02) + 1e-6]
    push = np.array(spec.push_mm)

    def at(scale: float) -> Faded:
        return Faded(BagMotion(low.mean(axis=0), scale, push), depth)

    lowest, highest = (MovedWall(wall, at(scale)).volume_change for scale in (0.55, 1.6))
    if not lowest < change < highest:
        raise InputError(
            f"walls.bladder: a volume change of {change / 1000:.1f} cc is asked for; this bladder allows "
            f"{lowest / 1000:.1f} to {highest / 1000:.1f} cc; change volume_change_cc, balance or the rectum's inflate_mm"
        )
    return at(float(brentq(lambda scale: MovedWall(wall, at(scale)).volume_change - change, 0.55, 1.6, xtol=1e-6)))


def _wall(labels: Volume, label: int, depth: Volume) -> Surface:
    """The wall within the modelled region; beyond it nothing moves."""
    _require(labels, label)
    surface = wall_surface(labels, label)
    inside = depth.at(surface.points) > 0.0
    faces = surface.faces[inside[surface.faces].any(axis=1)]
    return Surface(surface.points, faces, np.full(len(faces), label))


def _require(labels: Volume, label: int) -> None:
    if not (labels.array == label).any():
        raise InputError(
            f"walls.{LABELS[label]}: the labels hold no {LABELS[label]} ({label}); draw it or leave the wall out of the spec"
        )
