"""How much of hidden effects shows on the organ's surface."""

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
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import ORGAN_LABELS
from palpate.simulate.stiffness import Stiffness

# Equilibrium of the same body under the same walls with other materials.
Solve = Callable[[Mapping[int, Material]], Equilibrium]
# Numerical: a half is made so much stiffer, in ln G, for the surface's derivative.
_STEP = 0.1


class HiddenFigures(TypedDict):
    """shown_mm : rms over the organ's surface of what hidden effects move along its normal, the walls held where they were found.
    left_mm : of it, what no change of the two stiffnesses does as well, to first order.
    """

    shown_mm: float
    left_mm: float


def hidden_figures(mesh: TetMesh, u: FloatArray, stiffness: Stiffness, solve: Solve) -> HiddenFigures:
    """Figures of the effects in the state u (n, 3) mm that was found with them.

    Raises ConvergenceError where the same body without them has no equilibrium beside that state.
    """
    corners = np.unique(mesh.region_boundary(ORGAN_LABELS)[0])
    normals = Surface(mesh.points, *_faces(mesh)).point_normals[corners]

    def along_normal(of: Stiffness) -> FloatArray:
        at = solve(of.materials())
        if not at.converged:
            raise ConvergenceError(f"without its hidden effects the body has no equilibrium ({at.reason})")
        return np.einsum("ni,ni->n", at.u[corners], normals)

    plain = along_normal(stiffness)
    done = np.einsum("ni,ni->n", u[corners], normals) - plain
    stiffer = [
        replace(stiffness, organ={**stiffness.organ, label: float(np.exp(_STEP)) * G})
        for label, G in stiffness.organ.items()
    ]
    D = np.column_stack([(along_normal(of) - plain) / _STEP for of in stiffer])
    left = done - D @ np.linalg.lstsq(D, done, rcond=None)[0]
    return {"shown_mm": rms(done), "left_mm": rms(left)}


def _faces(mesh: TetMesh) -> tuple[IntArray, IntArray]:
    faces, owner = mesh.region_boundary(ORGAN_LABELS)
    return faces, mesh.regions[owner]
