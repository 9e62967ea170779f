"""How the bones moved between the scans, as their two surfaces show it: a rigid motion with its own uncertainty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.core.surfaces.rigid_motion import Motion, rigid_motion

_SPACING_MM = 6.0
# Distances beyond this are where a scan ends, not where a bone went, mm.
_FAR_MM = 12.0
# What no registration of contours is better than: mm, and degrees.
_FLOOR = np.array([0.15, 0.15, 0.15, 0.2, 0.2, 0.2])
_ROUNDS = 4


@dataclass(frozen=True, eq=False)
class BoneSight:
    """points (q, 3) mm on bone at rest; field : distance of the deformed scan's bone.

    design : (q, 6) takes a rigid motion (mm, degrees about the pivot) to distances; reader (6, q) distances to the motion still missing.
    misfit : (q,) mm, distances that are left where the bones fit best.
    """

    points: FloatArray
    field: SignedDistanceField
    design: FloatArray
    reader: FloatArray
    misfit: FloatArray

    @classmethod
    def of(cls, pair: SurfacePair, pivot: FloatArray) -> BoneSight | None:
        """None when the surfaces have too little in common."""
        points, normals, _, _ = sample_surface(pair.rest, _SPACING_MM)
        field = SignedDistanceField.from_surface(pair.deformed.points, pair.deformed.faces, spacing_mm=1.5)
        inside = _common(points, pair)
        points, normals = points[inside], normals[inside]
        if len(points) < 50:
            return None
        rotation = np.deg2rad(1.0) * np.cross(points - pivot, normals)
        N = np.hstack([normals, rotation])
        distance = field.value_and_gradient(points)[0]
        keep = np.abs(distance) < _FAR_MM
        weight = keep.astype(float)
        for _ in range(_ROUNDS):
            motion, *_rest = np.linalg.lstsq(N * weight[:, None], -distance * weight, rcond=None)
            left = distance + N @ motion
            spread = 1.4826 * np.median(np.abs(left[keep]))
            weight = keep * np.minimum(1.0, 1.5 * spread / np.maximum(np.abs(left), 1e-9)) ** 0.5
        points, N, W2 = points[keep], N[keep], weight[keep] ** 2
        reader = np.linalg.solve((N * W2[:, None]).T @ N, (N * W2[:, None]).T)
        return cls(points, field, N, reader, _misfit(points, field, reader, pivot))

    def residual(self, motion: Motion) -> FloatArray:
        """(6,) rigid motion (mm, degrees) by which the bones seem to be from where `motion` puts them, sign turned."""
        return self.reader @ self.field.value_and_gradient(self.points + motion(self.points))[0]

    @property
    def floor(self) -> FloatArray:
        """(6, 6) of the motion, what no registration of contours is better than."""
        return np.diag(_FLOOR**2)


def _misfit(points: FloatArray, field: SignedDistanceField, reader: FloatArray, pivot: FloatArray) -> FloatArray:
    """(q,) mm, distances after the rigid motion (about the pivot) that leaves the least."""
    motion = np.zeros(6)
    distance = field.value_and_gradient(points)[0]
    for _ in range(_ROUNDS):
        motion -= reader @ distance
        distance = field.value_and_gradient(points + rigid_motion(points, pivot, motion))[0]
    return np.asarray(distance)


def _common(points: FloatArray, pair: SurfacePair) -> BoolArray:
    """Points well within the box that both surfaces fill: at its ends the scan is cut, not the bone."""
    low = np.maximum(pair.rest.points.min(axis=0), pair.deformed.points.min(axis=0)) + 4.0
    high = np.minimum(pair.rest.points.max(axis=0), pair.deformed.points.max(axis=0)) - 4.0
    return ((points > low) & (points < high)).all(axis=1)
