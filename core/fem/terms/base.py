"""What a term is, and the base of those that act through displacements at points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


class Term(Protocol):
    """One contribution to the potential energy, as small dense blocks over displacement unknowns."""

    @property
    def unknowns(self) -> IntArray:
        """(b, k) displacement unknowns (3 node + component) of each block."""

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """Energy (mN mm), its gradient (b, k) mN and, with order 2, its second derivative (b, k, k) mN/mm.

        u : (n, 3) nodal displacements, mm. load : fraction of the full load, 0 to 1.
        """


@dataclass(frozen=True, eq=False)
class PointSet:
    """Points q whose displacement is v_q = sum_a weights[q, a] u[nodes[q, a]].

    nodes : (q, a) node indices. weights : (q, a). measure : (q,) what each point stands for (area mm2, or 1).
    """

    nodes: IntArray
    weights: FloatArray
    measure: FloatArray

    def displacements(self, u: FloatArray) -> FloatArray:
        """(q, 3) mm."""
        return np.einsum("qa,qai->qi", self.weights, u[self.nodes])

    def positions(self, nodes: FloatArray) -> FloatArray:
        """(q, 3) mm, the points' own rest positions for nodal coordinates (n, 3)."""
        return np.einsum("qa,qai->qi", self.weights, nodes[self.nodes])

    @property
    def unknowns(self) -> IntArray:
        """(q, 3 a)."""
        return (3 * self.nodes[:, :, None] + np.arange(3)).reshape(len(self.nodes), -1)

    def spread(self, f: FloatArray) -> FloatArray:
        """Point forces (q, 3) -> blocks (q, 3 a)."""
        return (self.weights[:, :, None] * f[:, None, :]).reshape(len(f), -1)

    def spread_tangent(self, H: FloatArray) -> FloatArray:
        """Point stiffnesses (q, 3, 3) -> blocks (q, 3 a, 3 a)."""
        k = 3 * self.nodes.shape[1]
        w = self.weights
        return np.einsum("qa,qij,qb->qaibj", w, H, w, optimize=True).reshape(len(H), k, k)

    @classmethod
    def of_matrix(cls, matrix: sp.csr_matrix, measure: FloatArray | None = None) -> PointSet:
        """From an interpolation matrix (q, n) with the same number of entries in every row."""
        matrix = sp.csr_matrix(matrix)
        width = np.diff(matrix.indptr)
        if len(width) == 0 or not (width == width[0]).all():
            raise ValueError("every row of the interpolation matrix needs the same number of entries")
        shape = (len(width), int(width[0]))
        ones = np.ones(len(width))
        nodes = matrix.indices.astype(np.int64).reshape(shape)
        return cls(nodes, matrix.data.reshape(shape), ones if measure is None else measure)


def face_points(nodes: FloatArray, face_nodes: IntArray) -> PointSet:
    """Three-point quadrature (exact for degree 2) of faces (f, 3 or 6 nodes) of the rest mesh; measure is area, mm2."""
    L = np.array([[2, 1 / 2, 1 / 2], [1 / 2, 2, 1 / 2], [1 / 2, 1 / 2, 2]]) / 3.0
    if face_nodes.shape[1] == 3:
        shape = L
    else:
        shape = np.hstack([L * (2 * L - 1), 4 * L * np.roll(L, -1, axis=1)])
    X = nodes[face_nodes[:, :3]]
    area = 0.5 * np.linalg.norm(np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]), axis=1)
    n = len(face_nodes)
    return PointSet(np.repeat(face_nodes, 3, axis=0), np.tile(shape, (n, 1)), np.repeat(area / 3.0, 3))


def face_node_points(face_nodes: IntArray, nodes: FloatArray) -> PointSet:
    """The nodes of faces (f, 3 or 6) themselves, each with an equal share of its faces' rest area, mm2.

    One point per node constrains each node's normal once; more quadrature points than nodes would resist sliding along a
    curved surface.
    """
    X = nodes[face_nodes[:, :3]]
    area = 0.5 * np.linalg.norm(np.cross(X[:, 1] - X[:, 0], X[:, 2] - X[:, 0]), axis=1)
    total = np.zeros(len(nodes))
    np.add.at(total, face_nodes, (area / face_nodes.shape[1])[:, None])
    used = np.unique(face_nodes)
    return PointSet(used[:, None], np.ones((len(used), 1)), total[used])
