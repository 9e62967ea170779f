"""What a term is, and the base of those that act through displacements at points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.surfaces.triangles import areas


class Term(Protocol):
    """One contribution to the potential energy, as small dense blocks over displacement unknowns."""

    @property
    def unknowns(self) -> IntArray:
        """(b, k) displacement unknowns (3 node + component) of each block."""

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """Energy (mN mm), its gradient (b, k) mN and, with order 2, its second derivative (b, k, k) mN/mm.

        u : (n, 3) nodal displacements, mm. load : fraction of the full load, 0 to 1.
        """


@runtime_checkable
class Particular(Protocol):
    """A term that has an energy only under some constraints."""

    def refusal(self, free: BoolArray) -> str | None:
        """Why it has none with these free unknowns (3 n,), or None."""


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


def triangle_quadrature(degree: int) -> tuple[FloatArray, FloatArray]:
    """Barycentric points (q, 3) and weights (q,) that sum to 1, exact to total degree 2 or 4 (Dunavant 1985)."""
    if degree <= 2:
        return np.array([[2, 1 / 2, 1 / 2], [1 / 2, 2, 1 / 2], [1 / 2, 1 / 2, 2]]) / 3.0, np.full(3, 1.0 / 3.0)
    rows, weights = [], []
    for a, w in ((0.445948490915964886, 0.223381589678011466), (0.0915762135097707435, 0.109951743655321868)):
        for k in range(3):
            rows.append(np.where(np.arange(3) == k, 1.0 - 2.0 * a, a))
            weights.append(w)
    return np.array(rows), np.array(weights)


def face_points(nodes: FloatArray, face_nodes: IntArray, degree: int = 2) -> PointSet:
    """Quadrature points of faces (f, 3 or 6 nodes) of the rest mesh; measure is area, mm2.

    degree : 2 gives three points a face; 4 gives six, which hold every node of a quadratic face.
    """
    L, weights = triangle_quadrature(degree)
    if face_nodes.shape[1] == 3:
        shape = L
    else:
        shape = np.hstack([L * (2 * L - 1), 4 * L * np.roll(L, -1, axis=1)])
    area = areas(nodes[face_nodes[:, :3]])
    q = len(L)
    return PointSet(
        np.repeat(face_nodes, q, axis=0), np.tile(shape, (len(face_nodes), 1)), np.outer(area, weights).ravel()
    )
