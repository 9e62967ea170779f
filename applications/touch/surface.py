"""Boundary surface of a body of linear tetrahedra for contact: faces, areas, nearest points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import TetMesh
from palpate.core.surfaces.closest_point import closest_points
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.core.surfaces.triangles import areas, point_normals


@dataclass(frozen=True, eq=False)
class Touched:
    """A point of the surface at rest. point, normal (3,) mm and outward; face : its index; signed : mm, of the place
    asked about.
    """

    point: FloatArray
    normal: FloatArray
    face: int
    signed: float


@dataclass(frozen=True, eq=False)
class ContactSurface:
    """points : (n, 3) mm, of the mesh. nodes : (s,) vertices on the outside. faces : (f, 3) vertices, outward; owner :
    (f,) cell behind.

    local_faces : (f, 3) the same as indices into `nodes`.
    """

    points: FloatArray
    nodes: IntArray
    faces: IntArray
    owner: IntArray
    local_faces: IntArray

    @classmethod
    def of(cls, mesh: TetMesh) -> ContactSurface:
        """All of a mesh's boundary."""
        faces, owner = mesh.boundary
        nodes, local = np.unique(faces, return_inverse=True)
        return cls(mesh.points, nodes, faces, owner, np.ascontiguousarray(local.reshape(-1, 3), dtype=np.int64))

    @cached_property
    def rest(self) -> FloatArray:
        """(s, 3) mm, positions of the nodes at rest."""
        return np.ascontiguousarray(self.points[self.nodes])

    @cached_property
    def unknowns(self) -> IntArray:
        """(f, 9) displacement unknowns of each face's corners."""
        return (3 * self.faces[:, :, None] + np.arange(3)).reshape(-1, 9)

    @cached_property
    def face_area(self) -> FloatArray:
        """(f,) mm2."""
        return areas(self.points[self.faces])

    @cached_property
    def node_area(self) -> FloatArray:
        """(s,) mm2, a third of the faces around each."""
        shares = np.repeat(self.face_area / 3.0, 3)
        return np.bincount(self.local_faces.ravel(), shares, len(self.nodes)).astype(np.float64)

    @cached_property
    def edge(self) -> float:
        """Typical edge of a face, mm."""
        return float(np.median(self.face_edge))

    @cached_property
    def face_edge(self) -> FloatArray:
        """(f,) mm, edge of the regular triangle of each face's area."""
        return np.asarray(np.sqrt(self.face_area * 4.0 / np.sqrt(3.0)))

    @cached_property
    def longest_edge(self) -> float:
        """mm."""
        X = self.points[self.faces]
        return float(np.linalg.norm(X - np.roll(X, 1, axis=1), axis=2).max())

    @cached_property
    def node_normals(self) -> FloatArray:
        """(s, 3) outward, weighted by area."""
        return point_normals(self.rest, self.local_faces)

    def nearest(self, x: FloatArray) -> Touched:
        """The point of the surface at rest nearest to x (3,) mm, with a normal that turns smoothly over edges."""
        closest = closest_points(self._tree, np.asarray(x, dtype=float)[None])
        face = int(closest.triangle[0])
        normal = closest.barycentric[0] @ self.node_normals[self.local_faces[face]]
        return Touched(closest.point[0], normal / np.linalg.norm(normal), face, float(closest.signed[0]))

    @cached_property
    def _tree(self) -> TriangleTree:
        return TriangleTree.of(self.points, self.faces)
