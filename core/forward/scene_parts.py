"""Parts of scenes: walls, dead loads and observation on a space, and an assembler on another rest shape."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import FloatArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.elements import EDGES
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import Term
from palpate.core.fem.terms.loads import PointForce, nodal_force
from palpate.core.fem.terms.wall import SlidingWall, wall_points
from palpate.core.observe.surface_observation import SurfaceObservation
from palpate.core.problem import IdentificationProblem, SurfacePair
from palpate.core.surfaces.distance_field import SignedDistanceField

# Signed distance fields of one surface at rest and deformed.
DistanceFields = tuple[SignedDistanceField, SignedDistanceField]

# Wall stiffness over the tissue's shear modulus, 1/mm. Nearly incompressible tissue that must make room pulls on a wall
# with up to ten times its modulus (measured): walls still stay within 0.03 mm of what was seen.
WALL_STIFFNESS = 400.0


def on_other_shape(assembler: Assembler, space: Space) -> Assembler:
    """Assembler with the same structure and solver on a space whose mesh has the same cells and other points.

    What depends on the shape is its own: weights, volume and the sums of the pressure unknowns.
    """
    out = copy.copy(assembler)
    out.space = space
    out.total_volume = float(space.mesh.volumes.sum())
    out.weight = np.ascontiguousarray(space.mesh.volumes[:, None] * space.element.weights)
    out.pressures = assembler.pressures.on_shape(space, out.weight)
    if assembler.materials:
        out.set_materials(assembler.materials)
    return out


def dead_load(space: Space, loads: Sequence[Term]) -> PointForce:
    """All dead loads as nodal forces. Present even when zero, so that a load does not change the matrix structure."""
    force = np.zeros((space.n_nodes, 3))
    for load in loads:
        np.add.at(force.reshape(-1), load.unknowns, -load.evaluate(np.zeros_like(force), 1.0, 1)[1])
    return nodal_force(np.arange(space.n_nodes), force)


def distance_fields(pair: SurfacePair) -> DistanceFields:
    """Signed distance fields of a surface at rest and deformed."""
    rest, deformed = (SignedDistanceField.from_surface(s.points, s.faces) for s in (pair.rest, pair.deformed))
    return rest, deformed


def driving_walls(problem: IdentificationProblem) -> dict[str, SurfacePair]:
    """The hollow organs' walls, by name, that both scans show and that the mesh has."""
    return {
        name: pair
        for name, pair in problem.walls.items()
        if name in problem.boundary and len(pair.rest.faces) and len(pair.deformed.faces)
    }


def wall_of(
    fields: DistanceFields,
    problem: IdentificationProblem,
    name: str,
    space: Space,
    scanned_nodes: FloatArray,
) -> SlidingWall:
    """Wall `name` of the mesh, between the distance fields of its surface at rest and deformed.

    scanned_nodes (n, 3) mm : the nodes where the scan at rest shows them.
    """
    points = wall_points(space.face_nodes(problem.boundary[name]), scanned_nodes)
    at_rest, deformed = fields
    scanned = points.positions(scanned_nodes)
    stiffness = WALL_STIFFNESS * problem.facts.tissue_shear_modulus_kpa
    wall = SlidingWall.between(points, scanned, at_rest.value_and_gradient, deformed.value_and_gradient, stiffness)
    moved = replace(wall, rest=points.positions(space.nodes))
    return moved.linearised_at(np.zeros_like(scanned))


def prolonged(u: FloatArray, space: Space) -> FloatArray:
    """Nodal values (n, 3) of a space from values u at its vertices; mid-edge nodes take the mean of their ends.

    Rows of u beyond the vertices are not read.
    """
    vertices = u[: len(space.mesh.points)]
    if space.element.degree == 1:
        return vertices.copy()
    out = np.empty((space.n_nodes, 3))
    out[: len(vertices)] = vertices
    out[space.cell_nodes[:, 4:]] = vertices[space.mesh.cells[:, EDGES]].mean(axis=2)
    return out


def moved_observation(
    observation: SurfaceObservation, space: Space, problem: IdentificationProblem
) -> SurfaceObservation:
    """The same observation, with operators on another space."""
    marks = observation.landmarks
    operator: sp.csr_matrix = space.interpolation(observation.points, problem.regions)
    return replace(
        observation,
        operator=operator,
        landmark_operator=space.interpolation(marks[:, :3], problem.regions),
        motion=observation.motion.on(space),
    )
