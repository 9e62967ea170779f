"""What is told of a simulated deformation: the organ's strain, whether the tissue folds, and the solve."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NotRequired, TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.newton.newton import Equilibrium
from palpate.core.fem.space import Space
from palpate.meshing.mesh_labels import MeshedCase


class SolverFigures(TypedDict):
    """Size of the problem and what its solve took; the rest is added by `solve.solve_deformed`.

    glide_rounds, glide_last_motion_mm : of gliding walls, and how far the last round moved them. contact : "tied" or "gliding".
    smallest_volume_ratio : of all cells.
    """

    element: str
    cells: int
    nodes: int
    load_steps: int
    factorisations: int
    relative_residual: float
    glide_rounds: NotRequired[int]
    glide_last_motion_mm: NotRequired[float]
    contact: NotRequired[str]
    smallest_volume_ratio: NotRequired[float]


def organ_strain(F: FloatArray, weight: FloatArray) -> dict[str, float]:
    """Size of the organ's strain from F (m, q, 3, 3) at points of volume weight (m, q) mm3.

    rms and p95 of the largest principal logarithmic (Hencky) strain by magnitude, max_i |ln lambda_i|, and the rms
    equivalent (von Mises) strain sqrt(2/3 dev H : dev H).
    """
    stretches = np.linalg.svd(F, compute_uv=False)
    H = np.log(stretches).reshape(-1, 3)
    share = weight.ravel() / weight.sum()
    largest = np.abs(H).max(axis=1)
    deviator = H - H.mean(axis=1, keepdims=True)
    order = np.argsort(largest)
    p95 = largest[order][np.searchsorted(np.cumsum(share[order]), 0.95)]
    return {
        "rms_largest_principal": float(np.sqrt(share @ largest**2)),
        "p95_largest_principal": float(p95),
        "rms_equivalent": float(np.sqrt(share @ (2.0 / 3.0 * (deviator**2).sum(axis=1)))),
    }


def smallest_volume_ratio(
    meshed: MeshedCase, F: FloatArray, walls: Mapping[str, tuple[FloatArray, FloatArray]]
) -> float:
    """Of F (m, q, 3, 3) over all cells. Raises ConvergenceError where it is not positive, naming the nearest wall that was moved.

    walls : name -> places (n, 3) at rest and motions (n, 3), mm.
    """
    ratio = np.linalg.det(F).min(axis=1)
    worst = int(ratio.argmin())
    if ratio[worst] > 0.0:
        return float(ratio[worst])
    place = meshed.mesh.points[meshed.mesh.cells[worst]].mean(axis=0)
    message = (
        f"the simulated tissue folds over itself (volume ratio {ratio[worst]:.2f} at {place.round(1).tolist()} mm)"
    )
    distances = {name: np.linalg.norm(points - place, axis=1) for name, (points, _) in walls.items()}
    if not distances:
        raise ConvergenceError(f"{message}; make the walls move less")
    name = min(distances, key=lambda key: float(distances[key].min()))
    nearest = int(distances[name].argmin())
    moved = float(np.linalg.norm(walls[name][1][nearest]))
    raise ConvergenceError(
        f"{message}, {distances[name][nearest]:.0f} mm from the {name}'s wall, which moves {moved:.1f} mm there; make that wall "
        "move less, over a longer half_length_mm, or inwards instead of outwards"
    )


def solver_figures(space: Space, found: Equilibrium) -> SolverFigures:
    """Size of the problem and what its solve took."""
    return {
        "element": space.element.name,
        "cells": len(space.mesh.cells),
        "nodes": space.n_nodes,
        "load_steps": found.load_steps,
        "factorisations": found.factorisations,
        "relative_residual": found.residual,
    }
