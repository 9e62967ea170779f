"""Deformation under known loads: for plans that state the cause of a deformation instead of the walls' motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.newton.newton import Equilibrium, solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.terms.base import Term
from palpate.core.forward.parameters import StiffnessParameters
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.surface import Surface

Loads = Callable[[Space], Sequence[Term]]
_HELD, _WALLS = ("bone", "outer"), ("bladder", "rectum")


@dataclass(frozen=True, eq=False)
class Loaded:
    """problem : with the walls' deformed surfaces as predicted, in place of a scan. equilibrium : under the loads."""

    problem: IdentificationProblem
    equilibrium: Equilibrium


def loaded(
    problem: IdentificationProblem,
    theta: FloatArray,
    loads: Loads,
    element: str = "p2p1",
    start: Equilibrium | None = None,
) -> Loaded:
    """Equilibrium of organ and tissue at theta = ln G (t,) under `loads`, with the walls free.

    Bone is held, and the outer surface where the case fixes it. start : equilibrium to start from.

    Raises InputError where nothing holds the body, no wall is there, or a load has no energy under these constraints.
    """
    space = Space.of(problem.mesh, element)
    held = [problem.boundary[n] for n in _HELD[: 2 if problem.facts.outer_fixed else 1] if n in problem.boundary]
    walls = [name for name in _WALLS if len(problem.boundary.get(name, ()))]
    if not held or not walls:
        raise InputError(
            "a load needs bone or a fixed outer surface to push against, and a bladder or rectum that moves"
        )
    free = np.ones((space.n_nodes, 3), dtype=bool)
    free[np.unique(space.face_nodes(np.vstack(held)))] = False
    assembler = Assembler(space, free.ravel(), loads(space))
    materials = StiffnessParameters(problem.regions, problem.facts).materials(theta)
    state = None if start is None else State(start.u, start.p)
    equilibrium = solve_equilibrium(assembler, materials, start=state)
    pairs = {name: _moved(problem.mesh.points, problem.boundary[name], equilibrium.u) for name in walls}
    return Loaded(replace(problem, walls=pairs), equilibrium)


def _moved(points: FloatArray, faces: IntArray, u: FloatArray) -> SurfacePair:
    """A wall's faces (f, 3) of the mesh at rest and displaced; normals point into the tissue, as a hollow organ's do."""
    used, inverse = np.unique(faces, return_inverse=True)
    turned = np.ascontiguousarray(inverse.reshape(-1, 3)[:, ::-1])
    label = np.zeros(len(turned), dtype=np.int64)
    return SurfacePair(
        Surface(points[used], turned, label), Surface(points[used] + u[: len(points)][used], turned, label)
    )
