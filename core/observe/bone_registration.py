"""Rigid motion of the bones between two scans, from their surfaces, with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.observe.slice_step import SliceStep, slice_step
from palpate.core.observe.surface_observation import sample_surface
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.core.surfaces.rigid_motion import Motion, rigid_motion

# Resolution: distance of the points that are read, mm; fewer than so many tell no motion; rounds of the robust fit.
_SPACING_MM, _FEWEST, _ROUNDS = 6.0, 50, 4


@dataclass(frozen=True, eq=False)
class BoneRegistration:
    """Rigid registration of the bones between two scans, ready to be compared with a predicted motion.

    points (q, 3) mm on bone at rest. field : signed distance of the deformed scan's bone. design (q, 6) : takes a rigid
    motion (mm, degrees about the pivot) to distances. reader (6, q) : takes distances to the motion still missing.
    misfit (q,) mm : distances left where the bones fit best. floor_sd (6,) : standard deviations that no registration
    of contours falls below.
    """

    points: FloatArray
    field: SignedDistanceField
    design: FloatArray
    reader: FloatArray
    misfit: FloatArray
    floor_sd: FloatArray

    @classmethod
    def of(cls, pair: SurfacePair, pivot: FloatArray, floor_sd: FloatArray, far_mm: float) -> BoneRegistration | None:
        """Registration of a pair of bone surfaces; None when they have too little in common.

        pivot (3,) mm : rotations are about it. floor_sd (6,) : see the class. far_mm : larger distances are left out,
        for they occur where a scan ends.
        """
        points, normals, _, _ = sample_surface(pair.rest, _SPACING_MM)
        field = SignedDistanceField.from_surface(pair.deformed.points, pair.deformed.faces, spacing_mm=1.5)
        inside = _common(points, pair)
        points, normals = points[inside], normals[inside]
        if len(points) < _FEWEST:
            return None
        rotation = np.deg2rad(1.0) * np.cross(points - pivot, normals)
        N = np.hstack([normals, rotation])
        distance = field.value_and_gradient(points)[0]
        keep = np.abs(distance) < far_mm
        weight = keep.astype(float)
        for _ in range(_ROUNDS):
            motion, *_rest = np.linalg.lstsq(N * weight[:, None], -distance * weight, rcond=None)
            residual = distance + N @ motion
            spread = 1.4826 * np.median(np.abs(residual[keep]))
            weight = keep * np.minimum(1.0, 1.5 * spread / np.maximum(np.abs(residual), 1e-9)) ** 0.5
        points, N, W2 = points[keep], N[keep], weight[keep] ** 2
        reader = np.linalg.solve((N * W2[:, None]).T @ N, (N * W2[:, None]).T)
        return cls(points, field, N, reader, _misfit(points, field, reader, pivot), floor_sd)

    def residual(self, motion: Motion) -> FloatArray:
        """Residual (6,): minus the rigid motion (mm, degrees) that would still take the bones from where `motion` puts
        them to where they are."""
        return self.reader @ self.field.value_and_gradient(self.points + motion(self.points))[0]

    @cached_property
    def residual_at_rest(self) -> FloatArray:
        """The residual (6,) where no bone moves, as in the plain model; found once."""
        return self.residual(np.zeros_like)

    @cached_property
    def step(self) -> SliceStep:
        """The step between slices that explains most of what the best rigid motion leaves; found once."""
        return slice_step(self.points, self.design, self.misfit)

    @property
    def floor(self) -> FloatArray:
        """Covariance (6, 6) of the motion that no registration of contours falls below (mm2, degrees2)."""
        return np.diag(self.floor_sd**2)


def _misfit(points: FloatArray, field: SignedDistanceField, reader: FloatArray, pivot: FloatArray) -> FloatArray:
    """Distances (q,) mm left after the rigid motion about the pivot (3,) that fits best."""
    motion = np.zeros(6)
    distance = field.value_and_gradient(points)[0]
    for _ in range(_ROUNDS):
        motion -= reader @ distance
        distance = field.value_and_gradient(points + rigid_motion(points, pivot, motion))[0]
    return np.asarray(distance)


def _common(points: FloatArray, pair: SurfacePair) -> BoolArray:
    """Points well within the common bounding box of both surfaces: near its faces the scan ends, not the bone."""
    low = np.maximum(pair.rest.points.min(axis=0), pair.deformed.points.min(axis=0)) + 4.0
    high = np.minimum(pair.rest.points.max(axis=0), pair.deformed.points.max(axis=0)) - 4.0
    return ((points > low) & (points < high)).all(axis=1)
