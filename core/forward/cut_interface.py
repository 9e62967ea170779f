"""A problem with the mesh cut between organ and surroundings, so that the two can slide along their common surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import IntArray
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import PointSet
from palpate.core.fem.terms.interface import SplitInterface, open_interface
from palpate.core.fem.terms.springs import Springs
from palpate.core.fem.terms.wall import wall_points
from palpate.core.problem import IdentificationProblem
from palpate.core.surfaces.triangles import point_normals


@dataclass(frozen=True, eq=False)
class CutProblem:
    """problem : on the cut mesh. split : the two sides of the cut. original : (n,) index each point had before the cut."""

    problem: IdentificationProblem
    split: SplitInterface
    original: IntArray


def cut_problem(problem: IdentificationProblem) -> CutProblem:
    """The problem with its mesh cut along the organ's surface. Raises InputError when organ and tissue share no face."""
    mesh = problem.mesh
    split = open_interface(mesh, problem.regions)
    n = len(mesh.points)
    twins = np.setdiff1d(np.arange(len(split.mesh.points)), np.arange(n))
    original = np.arange(len(split.mesh.points))
    inside = np.isin(mesh.regions, problem.regions)
    twin_of = np.arange(n)
    before, after = mesh.cells[inside].ravel(), split.mesh.cells[inside].ravel()
    twin_of[before] = after
    if len(twins):
        original[after] = before
    organ_faces = {tuple(sorted(f)) for f in mesh.region_boundary(problem.regions)[0].tolist()}
    boundary = {name: _renamed(faces, organ_faces, twin_of) for name, faces in problem.boundary.items()}
    return CutProblem(replace(problem, mesh=split.mesh, boundary=boundary), split, original)


def _renamed(faces: IntArray, organ_faces: set[tuple[int, ...]], twin_of: IntArray) -> IntArray:
    """Boundary faces (f, 3) with the organ's side of the cut where they belong to organ cells."""
    own = np.array([tuple(sorted(f)) in organ_faces for f in faces.tolist()], dtype=bool)
    out = faces.copy()
    out[own] = twin_of[faces[own]]
    return out


def sliding_springs(space: Space, split: SplitInterface, across: float, along: float) -> Springs:
    """Springs between the twin nodes of a cut. across, along : stiffness normal and tangential to the surface, kPa/mm.

    One spring per node, with the mean normal there. More springs than nodes would lock sliding along a curved surface,
    because its flat faces would have to pass through each other.
    """
    inner, outer = space.face_nodes(split.inner), space.face_nodes(split.outer)
    ours = wall_points(inner, space.nodes)
    twin = dict(zip(inner.ravel().tolist(), outer.ravel().tolist(), strict=True))
    nodes = ours.nodes[:, 0]
    pairs = np.column_stack([nodes, [twin[n] for n in nodes.tolist()]])
    points = PointSet(pairs, np.tile([1.0, -1.0], (len(pairs), 1)), ours.measure)
    normal = point_normals(space.nodes, inner)[nodes]
    nn = normal[:, :, None] * normal[:, None, :]
    S = across * nn + along * (np.eye(3) - nn)
    return Springs(points, S, np.zeros((len(pairs), 3)))
