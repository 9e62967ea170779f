"""Displacement of least energy that takes a body's surface onto an observed surface, free to slide along it.

Scans show the normal part of a surface's motion only. The tangential part is that of a uniform body under normal
pressures.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.materials import Material
from palpate.core.fem.newton.newton import solve_equilibrium
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import PointSet
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import SlidingWall, wall_points
from palpate.core.laws import LINEAR, bulk_modulus
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.distance_field import SignedDistanceField

# Rounds of linearisation; the first _STAGES of them approach the deformed surface in equal parts.
_ROUNDS, _STAGES = 8, 4
# Stiffness of the surface's springs over the body's shear modulus, 1/mm.
_WALL = 50.0
# Weak springs that hold the rigid motion of a round body, over its shear modulus, 1/mm2.
_HOLD = 1e-4


def slide_onto(
    space: Space, faces: IntArray, pair: SurfacePair, shear_modulus: float = 1.0, poisson_ratio: float = 0.4
) -> FloatArray:
    """Displacement (n, 3) mm of a uniform linear body whose boundary faces (f, 3) go from pair.rest onto pair.deformed.

    The displacement does not depend on the shear modulus (kPa). Raises ConvergenceError when the surfaces cannot be
    matched.
    """
    points = wall_points(space.face_nodes(faces), space.nodes)
    rest = points.positions(space.nodes)
    at_rest, deformed = (SignedDistanceField.from_surface(s.points, s.faces) for s in (pair.rest, pair.deformed))
    wall = SlidingWall.between(
        points, rest, at_rest.value_and_gradient, deformed.value_and_gradient, _WALL * shear_modulus
    )
    shift = pair.deformed.points.mean(axis=0) - pair.rest.points.mean(axis=0)
    every = PointSet(np.arange(space.n_nodes)[:, None], np.ones((space.n_nodes, 1)), np.ones(space.n_nodes))
    hold = Springs(every, _HOLD * shear_modulus * np.eye(3), np.tile(shift, (space.n_nodes, 1)))
    assembler = Assembler(space, np.ones(space.n_displacements, dtype=bool), [wall, hold])
    return _slide(assembler, wall, hold, _uniform(space, shear_modulus, poisson_ratio), shift)


def _slide(
    assembler: Assembler, wall: SlidingWall, hold: Springs, materials: Mapping[int, Material], shift: FloatArray
) -> FloatArray:
    u = np.tile(shift, (assembler.space.n_nodes, 1))
    for k in range(_ROUNDS):
        assembler.terms = (wall.linearised(u, min(1.0, (k + 1) / _STAGES)), hold)
        equilibrium = solve_equilibrium(assembler, materials)
        if not equilibrium.converged:
            raise ConvergenceError(f"the organ's two surfaces cannot be matched: {equilibrium.reason}")
        u = equilibrium.u
    return u


def _uniform(space: Space, G: float, poisson_ratio: float) -> dict[int, Material]:
    values = np.array([G, bulk_modulus(G, poisson_ratio)])
    return {int(r): Material(LINEAR, values) for r in np.unique(space.mesh.regions)}
