"""A body of quadratic tetrahedra on scikit-fem: its space, quadrature and assembly.

Of the program that diagnoses only the direct linear solver is used, which either solves or does not.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from skfem import Basis, ElementTetP2, MeshTet
from skfem.assembly.form.coo_data import COOData

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.linear.choice import make_solver
from palpate.core.fem.linear.pattern import Pattern
from palpate.validate.blind.simulator.laws import Dilation, Organ, Tissue

Laws = Mapping[int, Organ | Tissue]


@dataclass(frozen=True, eq=False)
class Body:
    """points (v, 3) mm, cells (m, 4), regions (m,): quadratic displacement on straight-sided cells, four points and one pressure each."""

    points: FloatArray
    cells: IntArray
    regions: IntArray

    @cached_property
    def basis(self) -> Basis:
        """scikit-fem's scalar space; a displacement has three values a node."""
        return Basis(MeshTet(self.points.T.copy(), self.cells.T.copy()), ElementTetP2(), intorder=2)

    @cached_property
    def nodes(self) -> FloatArray:
        """(n, 3) mm: corners, then mid-edges."""
        return np.ascontiguousarray(self.basis.doflocs.T)

    @cached_property
    def cell_nodes(self) -> IntArray:
        """(m, 10): corners, then the mid-edges 01, 12, 02, 03, 13, 23."""
        return np.ascontiguousarray(self.basis.element_dofs.T).astype(np.int64)

    @cached_property
    def slopes(self) -> FloatArray:
        """(m, q, 10, 3) 1/mm, gradients of the shape functions at the quadrature points."""
        grads = np.stack([b[0].grad for b in self.basis.basis])  # (10, 3, m, q)
        return np.ascontiguousarray(grads.transpose(2, 3, 0, 1))

    @cached_property
    def weights(self) -> FloatArray:
        """(m, q) mm3."""
        return np.asarray(self.basis.dx)

    def gradients(self, u: FloatArray) -> FloatArray:
        """F (m, q, 3, 3) of a displacement u (n, 3) mm."""
        return np.eye(3) + np.einsum("mai,mqaj->mqij", u[self.cell_nodes], self.slopes, optimize=True)

    def face_nodes(self, faces: IntArray) -> IntArray:
        """Nodes (f, 6) of faces (f, 3) given by corners; mid-edges in the order 01, 12, 20."""
        pairs = self.cell_nodes[:, [[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]]].reshape(-1, 2)
        middle = self.cell_nodes[:, 4:].ravel()
        table = {(min(p), max(p)): n for p, n in zip(pairs.tolist(), middle.tolist(), strict=True)}
        edges = [[table[min(p), max(p)] for p in ((a, b), (b, c), (c, a))] for a, b, c in faces.tolist()]
        return np.hstack([faces, np.array(edges, dtype=np.int64).reshape(-1, 3)])

    def assemble(self, u: FloatArray, laws: Laws) -> tuple[FloatArray, sparse.csr_matrix]:
        """Internal force (3 n,) mN and its derivative (3 n, 3 n) mN/mm. Not finite where an organ's cell is turned inside out."""
        F = self.gradients(u)
        m, q = self.weights.shape
        force, summed = np.zeros((m, 10, 3)), np.zeros((9, self._pattern[0].nnz))
        for region, law in laws.items():
            here = np.flatnonzero(self.regions == region)
            D, at = self.slopes[here], F[here].reshape(-1, 3, 3)
            pressure, swelling = self._mean_dilation(here, law.dilation(at))
            if isinstance(law, Tissue) and law.constant:
                P = law.stress(at, pressure)
                summed += self._kept_tangent(here, law, at, pressure, swelling)
            else:
                P, A = law.response(at, pressure)
                summed += self._tangent(here, A, swelling)
            P = P.reshape(-1, q, 3, 3) * self.weights[here][..., None, None]
            force[here] = np.einsum("mqaj,mqij->mai", D, P, optimize=True)
        total = np.zeros((len(self.nodes), 3))
        np.add.at(total, self.cell_nodes, force)
        return total.ravel(), self._matrix(summed)

    def _mean_dilation(self, here: IntArray, d: Dilation) -> tuple[FloatArray, FloatArray]:
        """Pressure (p,) kPa of the cells' mean dilation, and (m, 10, 3) whose outer products it adds to the cells' tangents.

        One pressure a cell (Nagtegaal, Parks & Rice 1974): with four, cells of nu = 0.49 and more keep an organ from bending.
        """
        w = self.weights[here]
        volume, modulus = w.sum(axis=1), d.modulus.reshape(w.shape)[:, 0]
        mean = (w * d.value.reshape(w.shape)).sum(axis=1) / volume
        slope = d.slope.reshape(*w.shape, 3, 3) * w[..., None, None]
        swelling = np.einsum("mqij,mqaj->mai", slope, self.slopes[here], optimize=True)
        return np.repeat(modulus * mean, w.shape[1]), swelling * np.sqrt(modulus / volume)[:, None, None]

    def _kept_tangent(
        self, here: IntArray, law: Tissue, F: FloatArray, pressure: FloatArray, swelling: FloatArray
    ) -> FloatArray:
        """Of cells whose tangent does not change: most of a pelvis is linear."""
        kept = self._kept
        if not kept or kept[0][0] is not law.G or kept[0][1] is not law.K:
            kept[:] = [(law.G, law.K, self._tangent(here, law.response(F, pressure)[1], swelling))]
        return kept[0][2]

    @cached_property
    def _kept(self) -> list[tuple[FloatArray, FloatArray, FloatArray]]:
        return []

    def _tangent(self, here: IntArray, A: FloatArray, swelling: FloatArray) -> FloatArray:
        """(9, pairs) sums over the cells `here`, whose law has the tangent A (p, 3, 3, 3, 3) at constant pressure."""
        pattern, place = self._pattern
        w, D = self.weights[here], self.slopes[here]
        A = A.reshape(*w.shape, 3, 3, 3, 3) * w[..., None, None, None, None]
        half = np.einsum("mqaj,mqijkl->mqaikl", D, A, optimize=True)
        blocks = np.einsum("mqaikl,mqbl->ikmab", half, D, optimize=True)
        blocks += np.einsum("mai,mbk->ikmab", swelling, swelling)
        blocks = blocks.reshape(9, -1)
        where = place.reshape(len(self.cell_nodes), -1)[here].ravel()
        return np.stack([np.bincount(where, column, minlength=pattern.nnz) for column in blocks])

    @cached_property
    def _pattern(self) -> tuple[sparse.csr_matrix, IntArray]:
        """Which nodes share a cell, by scikit-fem's assembly, and where in it every pair of a cell's nodes is."""
        n = len(self.nodes)
        pairs = np.stack([np.repeat(self.cell_nodes, 10, axis=1).ravel(), np.tile(self.cell_nodes, (1, 10)).ravel()])
        pattern = COOData(pairs, np.ones(pairs.shape[1]), (n, n), None).tocsr()
        pattern.sort_indices()
        keys = np.repeat(np.arange(n), np.diff(pattern.indptr)) * n + pattern.indices
        return pattern, np.searchsorted(keys, pairs[0] * n + pairs[1])

    def solver(self, K: sparse.csr_matrix, free: BoolArray) -> _Solver:
        """Of this body's matrices, for unknowns free (3 n,) of bool; the same one as long as the same are free."""
        key = free.tobytes()
        if key not in self._solvers:
            self._solvers.clear()
            self._solvers[key] = _Solver(K, free)
        return self._solvers[key]

    @cached_property
    def _solvers(self) -> dict[bytes, _Solver]:
        return {}

    def _matrix(self, summed: FloatArray) -> sparse.csr_matrix:
        """(3 n, 3 n) of the sums (9, pairs)."""
        pattern, _ = self._pattern
        size = 3 * len(self.nodes)
        blocks = np.ascontiguousarray(summed.T).reshape(-1, 3, 3)
        return sparse.bsr_matrix((blocks, pattern.indices, pattern.indptr), shape=(size, size)).tocsr()


class _Solver:
    """Direct solver for the free unknowns of a body's matrices, analysed once."""

    def __init__(self, K: sparse.csr_matrix, free: BoolArray) -> None:
        # Where in K's values the upper triangle of the free unknowns is.
        numbered = sparse.csr_matrix((np.arange(1.0, K.nnz + 1.0), K.indices, K.indptr), shape=K.shape)
        upper = sparse.triu(numbered[free][:, free], format="csr")
        upper.sort_indices()
        self._place = upper.data.astype(np.int64) - 1
        indptr, indices = upper.indptr.astype(np.int32), upper.indices.astype(np.int32)
        self._solver = make_solver(Pattern(upper.shape[0], indptr, indices, ()))

    def solve(self, K: sparse.csr_matrix, rhs: FloatArray) -> FloatArray:
        """x with K x = rhs on the free unknowns. Raises FactorisationError."""
        self._solver.factorise(K.data[self._place])
        return self._solver.solve(rhs)
