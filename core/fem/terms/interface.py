"""An interface between two meshes' sides that share no nodes: held together across, and along as stiffly as asked."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.errors import InputError
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import FloatArray, IntArray, PointSet, face_points
from palpate.core.fem.terms.springs import Springs
from palpate.core.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class SplitInterface:
    """A mesh whose faces between two sets of regions were opened: every node there exists twice.

    mesh : the opened mesh. inner, outer : (f, 3) the same faces seen by the two sides, vertex by vertex.
    """

    mesh: TetMesh
    inner: IntArray
    outer: IntArray


def open_interface(mesh: TetMesh, inner_regions: tuple[int, ...]) -> SplitInterface:
    """Duplicate the nodes on the faces between `inner_regions` and the rest. Raises InputError when there is no such face."""
    inside = np.isin(mesh.regions, inner_regions)
    faces, _ = mesh.region_boundary(inner_regions)
    outer_nodes = np.unique(mesh.cells[~inside])
    shared = np.isin(faces, outer_nodes).all(axis=1)
    outside_faces, _ = mesh._one_sided(np.flatnonzero(~inside))
    keys = {tuple(sorted(f)) for f in outside_faces.tolist()}
    shared &= np.array([tuple(sorted(f)) in keys for f in faces.tolist()], dtype=bool)
    if not shared.any():
        raise InputError(f"regions {inner_regions} share no face with the rest of the mesh")
    faces = faces[shared]
    nodes = np.intersect1d(np.unique(mesh.cells[inside]), outer_nodes)
    twin = np.arange(len(mesh.points))
    twin[nodes] = len(mesh.points) + np.arange(len(nodes))
    cells = mesh.cells.copy()
    cells[inside] = twin[cells[inside]]
    opened = TetMesh(np.vstack([mesh.points, mesh.points[nodes]]), cells, mesh.regions)
    return SplitInterface(opened, twin[faces], faces)


def interface_springs(
    space: Space, split: SplitInterface, normal_stiffness: float, tangential_stiffness: float
) -> Springs:
    """Springs between the two sides: `normal_stiffness` across and `tangential_stiffness` along the rest surface, kPa/mm.

    Tied: both large. Sliding: tangential 0. The tangential compliance (mm/kPa) is the inverse of `tangential_stiffness`.
    """
    degree = 2 * space.element.degree  # fewer points would leave some nodes of a quadratic face untied
    inner = face_points(space.nodes, space.face_nodes(split.inner), degree)
    outer = face_points(space.nodes, space.face_nodes(split.outer), degree)
    jump = PointSet(np.hstack([inner.nodes, outer.nodes]), np.hstack([inner.weights, -outer.weights]), inner.measure)
    X = space.nodes[split.inner]
    normal: FloatArray = np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0])
    points_a_face = len(jump.measure) // len(split.inner)
    normal = np.repeat(normal / np.linalg.norm(normal, axis=1)[:, None], points_a_face, axis=0)
    nn = normal[:, :, None] * normal[:, None, :]
    S = normal_stiffness * nn + tangential_stiffness * (np.eye(3) - nn)
    return Springs(jump, S, np.zeros((len(normal), 3)))
