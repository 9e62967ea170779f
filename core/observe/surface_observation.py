"""Signed distance of the organ's predicted surface from its surface in the deformed scan, and landmarks.

The residual of a point X of the rest surface is d(X + u(X)), with d the signed distance of the deformed organ's surface.
It is the one-sided distance of Eqs 11 to 13 of Yang & Lin, MaterialCloning, with a sign: its square is their objective,
and its derivative exists everywhere. Points near the line where regions meet are left out, as they leave out shared
nodes (section 3.2.5).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.space import Space
from palpate.core.observe.motion_observation import MotionObservation
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.distance_field import SignedDistanceField
from palpate.core.surfaces.surface import Surface

# Points closer than this to the dividing line of two regions are left out.
RIM_MM = 3.0


@dataclass(frozen=True, eq=False)
class SurfaceObservation:
    """points : (q, 3) mm on the organ's rest surface; normals (q, 3); region (q,); area (q,) mm2 each stands for.

    operator : (q, n) takes nodal displacements to the points. target : signed distance of the deformed surface.
    landmarks : (k, 6), their operator (k, n). motion : what the images tell of the motion; no data without images.
    """

    points: FloatArray
    normals: FloatArray
    region: IntArray
    area: FloatArray
    operator: sp.csr_matrix
    target: SignedDistanceField
    landmarks: FloatArray
    landmark_operator: sp.csr_matrix
    motion: MotionObservation

    @classmethod
    def of(
        cls,
        problem: IdentificationProblem,
        space: Space,
        spacing_mm: float = 2.0,
        target: SignedDistanceField | None = None,
        reader: FloatArray | None = None,
    ) -> SurfaceObservation:
        """Sample the organ's rest surface about every `spacing_mm`. target, reader of matched motion : where known already."""
        points, normals, region, area = sample_surface(problem.organ.rest, spacing_mm)
        deformed = problem.organ.deformed
        return cls(
            points,
            normals,
            region,
            area,
            space.interpolation(points, problem.regions),
            target or SignedDistanceField.from_surface(deformed.points, deformed.faces),
            problem.landmarks,
            space.interpolation(problem.landmarks[:, :3], problem.regions),
            MotionObservation.of(problem.matched, space, reader),
        )

    @cached_property
    def all_points(self) -> sp.csr_matrix:
        """Operator (q + k + p, n) that takes nodal displacements to surface points, landmarks and nodes of matched motion."""
        return sp.vstack([self.operator, self.landmark_operator, self.motion.operator]).tocsr()

    @property
    def every_place(self) -> FloatArray:
        """Positions (q + k + w, 3) mm at rest of surface points, landmarks and places of matched motion."""
        return np.vstack([self.points, self.landmarks[:, :3], self.motion.rows.places])

    def parts_of(self, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Rows of v (q + k + p, 3) that belong to the surface, to the landmarks and to nodes of matched motion."""
        q, k = len(self.points), len(self.landmarks)
        return v[:q], v[q : q + k], v[q + k :]

    def residual(self, u: FloatArray) -> FloatArray:
        """Residual (q,) mm for nodal displacements u (n, 3) mm."""
        return self.residual_of(self.operator @ u)

    def residual_of(self, v: FloatArray) -> FloatArray:
        """Residual (q,) mm for displacements v (q, 3) mm of the observed points."""
        return self.target.value_and_gradient(self.points + v)[0]

    def residual_and_normal(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residual (q,) mm and its derivative (q, 3) in the points' displacements, for nodal displacements u (n, 3) mm."""
        return self.target.value_and_gradient(self.points + self.operator @ u)

    def jacobian(self, u: FloatArray, sensitivities: FloatArray) -> FloatArray:
        """Derivative (q, t) of the residual, mm per unit of theta, for sensitivities du/dtheta (t, n, 3) at u (n, 3)."""
        _, normal = self.residual_and_normal(u)
        return np.stack([((self.operator @ s) * normal).sum(axis=1) for s in sensitivities], axis=1)

    def landmark_residual(self, u: FloatArray) -> FloatArray:
        """Predicted minus observed positions (k, 3) mm of interior points, for nodal displacements u (n, 3) mm."""
        return self.landmarks[:, :3] + self.landmark_operator @ u - self.landmarks[:, 3:]


def sample_surface(surface: Surface, spacing_mm: float) -> tuple[FloatArray, FloatArray, IntArray, FloatArray]:
    """Sample of a surface about every `spacing_mm`: points (q, 3) mm, outward normals (q, 3), regions (q,) and areas
    (q,) mm2.

    Triangle centres are grouped by cubes of that size; each cube yields the triangle centre nearest to its
    area-weighted mean. Points within RIM_MM of a line between regions are left out.
    """
    centre = surface.points[surface.faces].mean(axis=1)
    keep = _away_from_rim(surface, centre)
    area, normal = surface.areas[keep], surface.face_normals[keep]
    centre, region = centre[keep], surface.region[keep]
    cube = np.floor(centre / spacing_mm).astype(np.int64)
    keys = np.column_stack([cube, region])
    _, group = np.unique(keys, axis=0, return_inverse=True)
    group = group.ravel()
    total = np.bincount(group, area)
    mean = np.stack([np.bincount(group, area * centre[:, i]) for i in range(3)], axis=1) / total[:, None]
    _, nearest = cKDTree(centre).query(mean)
    return centre[nearest], normal[nearest], region[nearest], np.asarray(total, dtype=np.float64)


def _away_from_rim(surface: Surface, centre: FloatArray) -> BoolArray:
    if len(surface.rim) == 0:
        return np.ones(len(centre), dtype=bool)
    distance, _ = cKDTree(surface.points[surface.rim]).query(centre)
    return distance > RIM_MM
