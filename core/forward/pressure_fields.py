"""Displacement of the body when a hollow organ fills: directions in which a scan at rest may be loaded already."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.assembly import Assembler
from palpate.core.fem.sensitivity import response_to_forces
from palpate.core.fem.space import Space
from palpate.core.fem.state import State
from palpate.core.fem.tangent import Tangent
from palpate.core.fem.terms.base import face_points
from palpate.core.forward.composition_scene import CompositionScene
from palpate.core.forward.shared_geometry import SharedGeometry
from palpate.core.surfaces.triangles import normals


def pressure_fields(geometry: SharedGeometry, scene: CompositionScene, theta: FloatArray) -> dict[str, FloatArray]:
    """Wall name -> linear displacement (points, 3) mm under a uniform pressure on that wall alone.

    Scaled to 1 mm rms on the wall. theta (t,) : ln G. scene : of the plain model.
    """
    problem = geometry.problem
    space = Space.of(problem.mesh, "p1p1")
    free = np.ones((space.n_nodes, 3), dtype=bool)
    free[np.unique(_held(scene, space))] = False
    assembler = Assembler(space, free.ravel())
    assembler.set_materials(scene.parameters.materials(theta))
    tangent = Tangent(assembler, State(np.zeros((space.n_nodes, 3)), np.zeros(space.n_pressures)))
    out = {}
    for name in geometry.fields:
        faces = problem.boundary[name]
        points = face_points(space.nodes, faces)
        normal = -normals(space.nodes[faces])  # into the tissue: outwards seen from the hollow organ
        force = np.zeros((space.n_nodes, 3))
        pushed = points.spread(points.measure[:, None] * np.repeat(normal, 3, axis=0))
        np.add.at(force.reshape(-1), points.unknowns, pushed)
        u = response_to_forces(tangent, force[None])[0]
        wall = np.unique(faces)
        out[name] = u / np.sqrt((u[wall] ** 2).sum(axis=1).mean())
    return out


def _held(scene: CompositionScene, space: Space) -> IntArray:
    names = ("bone", "outer") if scene.problem.facts.outer_fixed else ("bone",)
    boundary = scene.geometry.problem.boundary
    return np.vstack([space.face_nodes(boundary[n]) for n in names if n in boundary])
