"""How much of hidden effects shows on the organ's surface, and near it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.mesh import TetMesh
from palpate.core.statistics import rms
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.surface import Surface
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.imaging.labels import ORGAN_LABELS
from palpate.simulate.stiffness import Stiffness

# Equilibrium of the same body under the same walls with other materials.
Solve = Callable[[Mapping[int, Material]], Equilibrium]
# Numerical: a half is made so much stiffer, in ln G, for the surface's derivative.
_STEP = 0.1
# How far from the organ's surface motion counts as near it.
_NEAR_MM = 15.0


class HiddenFigures(TypedDict):
    """shown_mm : rms over the organ's surface of what hidden effects move along its normal, the walls held where they were found.
    left_mm : of it, what no change of the two stiffnesses does as well, to first order. left_near_mm : the same of all motion of organ
    and tissue within `_NEAR_MM` of the organ's surface, which is what images see.
    """

    shown_mm: float
    left_mm: float
    left_near_mm: float


def hidden_figures(mesh: TetMesh, u: FloatArray, stiffness: Stiffness, solve: Solve) -> HiddenFigures:
    """Figures of the effects in the state u (n, 3) mm that was found with them.

    Raises ConvergenceError where the same body without them has no equilibrium beside that state.
    """
    surface = mesh.region_boundary(ORGAN_LABELS)[0]
    corners = np.unique(surface)
    normals = Surface(mesh.points, *_faces(mesh)).point_normals[corners]
    near = closest_points(TriangleTree.of(mesh.points, surface), mesh.points).distance < _NEAR_MM

    def solved(of: Stiffness) -> FloatArray:
        at = solve(of.materials())
        if not at.converged:
            raise ConvergenceError(f"without its hidden effects the body has no equilibrium ({at.reason})")
        return np.asarray(at.u[: len(mesh.points)])

    plain = solved(stiffness)
    stiffer = [
        replace(stiffness, organ={**stiffness.organ, label: float(np.exp(_STEP)) * G})
        for label, G in stiffness.organ.items()
    ]
    by_stiffness = [(solved(of) - plain) / _STEP for of in stiffer]
    done = u[: len(mesh.points)] - plain

    def along_normal(motion: FloatArray) -> FloatArray:
        return np.einsum("ni,ni->n", motion[corners], normals)

    def moved(motion: FloatArray) -> FloatArray:
        return np.asarray(motion[near].ravel())

    left = _left(along_normal(done), np.column_stack([along_normal(motion) for motion in by_stiffness]))
    left_near = _left(moved(done), np.column_stack([moved(motion) for motion in by_stiffness]))
    per_point = np.linalg.norm(left_near.reshape(-1, 3), axis=1)
    return {"shown_mm": rms(along_normal(done)), "left_mm": rms(left), "left_near_mm": rms(per_point)}


def _left(done: FloatArray, by_stiffness: FloatArray) -> FloatArray:
    """done (n,) less what the columns of by_stiffness (n, k) explain of it."""
    return np.asarray(done - by_stiffness @ np.linalg.lstsq(by_stiffness, done, rcond=None)[0])


def _faces(mesh: TetMesh) -> tuple[IntArray, IntArray]:
    faces, owner = mesh.region_boundary(ORGAN_LABELS)
    return faces, mesh.regions[owner]
