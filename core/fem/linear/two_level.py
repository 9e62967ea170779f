"""Preconditioner of the displacements' block of a quadratic element: smoothing, and the linear element as coarse space.

Linear displacements are quadratic ones whose mid-edges go with the mean of their ends. That is the coarse space of a symmetric
two-level cycle (p-multigrid; Sundar, Stadler & Biros 2015, Numer. Linear Algebra Appl. 22:664): its matrix, of an eighth of the
unknowns, is factorised; what it cannot show is smoothed by Chebyshev polynomials over the nodes' 3 x 3 blocks (Adams et al. 2003,
J. Comput. Phys. 188:593). All in single precision: it only guides an iteration that corrects itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import BoolArray, Float32Array, FloatArray, Int32Array, IntArray
from palpate.core.fem.linear.direct import make_direct
from palpate.core.fem.linear.direct_solver import SymmetricSolver
from palpate.core.fem.linear.pattern import Pattern

# Degree of the polynomial before and after the coarse step, and the share of the largest eigenvalue from which on it damps. Degrees of
# 1 to 3 take 5.0 to 6.8 s of processor time for one equilibrium of 20,000 cells, most of it for the coupling with the pressures.
# Margin on the estimate of that eigenvalue, and steps of the estimate.
_DEGREE, _DAMPED, _MARGIN = 2, 1.0 / 4.0, 1.1
_POWER_STEPS, _POWER_AGAIN = 15, 5


@dataclass(frozen=True, eq=False)
class Levels:
    """How the free displacement unknowns of a quadratic element go with those of the linear one.

    nodes (n,) node of each free unknown, components (n,) 0 to 2. prolongation (n, c) : fine values of c coarse unknowns.
    """

    nodes: IntArray
    components: IntArray
    prolongation: sp.csr_matrix

    @classmethod
    def of(cls, free: BoolArray, vertices: int, parents: IntArray) -> Levels:
        """free : (3 k,) whether each unknown is solved for. vertices : their number; they are the first nodes. parents (k - vertices, 2) :
        ends of the edge that each other node halves.
        """
        ends = np.vstack([np.repeat(np.arange(vertices)[:, None], 2, axis=1), parents])
        fine = np.flatnonzero(free)
        nodes, components = fine // 3, fine % 3
        coarse_free = free[: 3 * vertices]
        number = np.where(coarse_free, np.cumsum(coarse_free) - 1, -1)
        columns = number[3 * ends[nodes] + components[:, None]].ravel()
        rows, kept = np.repeat(np.arange(len(fine)), 2), columns >= 0
        half = np.full(int(kept.sum()), 0.5, dtype=np.float32)
        shape = (len(fine), int(coarse_free.sum()))
        return cls(nodes, components, sp.csr_matrix((half, (rows[kept], columns[kept])), shape=shape))


class TwoLevel:
    """Symmetric z = M r for the displacements' block K. matrix : K (n, n) in single precision, the one that was set last."""

    def __init__(self, structure: sp.csr_matrix, levels: Levels) -> None:
        """structure : (n, n) of the full K, its data the position of each entry among the values that `set` is given."""
        self._take: Int32Array = structure.data.astype(np.int32)
        self.matrix = sp.csr_matrix(
            (np.zeros(len(self._take), dtype=np.float32), structure.indices, structure.indptr), shape=structure.shape
        )
        self._levels, self._restriction = levels, levels.prolongation.T.tocsr()
        self._blocks = _Blocks(self.matrix, levels)
        self._coarse: _Coarse | None = None
        self._largest = 1.0
        self._vector = np.random.default_rng(0).normal(size=structure.shape[0]).astype(np.float32)
        self._steps = _POWER_STEPS

    def set(self, values: FloatArray) -> None:
        """Take a new K. Raises FactorisationError when its coarse matrix, or a node's block, is singular."""
        self.matrix.data[:] = values[self._take]
        self._blocks.invert()
        coarse = sp.triu(self._restriction @ (self.matrix @ self._levels.prolongation)).tocsr()
        coarse.sort_indices()
        if self._coarse is None or not self._coarse.fits(coarse):
            self._coarse = _Coarse(coarse)
        self._coarse.factorise(coarse)
        for _ in range(self._steps):
            image = self._blocks.solve(self.matrix @ self._vector)
            self._largest = float(np.linalg.norm(image))
            self._vector = image / np.float32(self._largest)
        self._steps = _POWER_AGAIN

    @property
    def falls(self) -> bool:
        """Whether the coarse matrix already has a direction of negative curvature."""
        assert self._coarse is not None
        return self._coarse.solver.n_negative() > 0

    def apply(self, r: FloatArray) -> FloatArray:
        """M r (n,). Precondition: a K was set."""
        assert self._coarse is not None
        b = r.astype(np.float32)
        x = self._smoothed(b, None)
        x += self._levels.prolongation @ self._coarse.solve(self._restriction @ (b - self.matrix @ x))
        return self._smoothed(b, x).astype(np.float64)

    def _smoothed(self, b: Float32Array, x: Float32Array | None) -> Float32Array:
        """Chebyshev steps of K x = b from x, None for 0 (Saad 2003, Iterative Methods for Sparse Linear Systems, algorithm 12.1)."""
        high = np.float32(_MARGIN * self._largest)
        low = np.float32(_DAMPED) * high
        centre, half = (high + low) / 2, (high - low) / 2
        sigma = centre / half
        rho = 1 / sigma
        residual = b if x is None else b - self.matrix @ x
        step = self._blocks.solve(residual) / centre
        x = step.copy() if x is None else x + step
        for _ in range(_DEGREE - 1):
            residual = residual - self.matrix @ step
            following = 1 / (2 * sigma - rho)
            step = (following * rho) * step + (2 * following / half) * self._blocks.solve(residual)
            rho = following
            x += step
        return x


class _Blocks:
    """Inverse of the nodes' blocks of a matrix, which may change its values."""

    def __init__(self, matrix: sp.csr_matrix, levels: Levels) -> None:
        rows = np.repeat(np.arange(matrix.shape[0], dtype=np.int32), np.diff(matrix.indptr))
        self._at = np.flatnonzero(levels.nodes[rows] == levels.nodes[matrix.indices])
        rows, columns = rows[self._at], matrix.indices[self._at]
        _, node = np.unique(levels.nodes, return_inverse=True)
        self._where = node[rows], levels.components[rows], levels.components[columns]
        self._matrix, self._count = matrix, int(node.max()) + 1
        indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=matrix.shape[0]))]).astype(np.int32)
        self._inverse = sp.csr_matrix((np.zeros(len(rows), dtype=np.float32), columns, indptr), shape=matrix.shape)

    def invert(self) -> None:
        """Take the matrix's present values."""
        blocks = np.zeros((self._count, 3, 3))
        blocks[self._where] = self._matrix.data[self._at]
        empty = blocks[:, range(3), range(3)] == 0.0  # components that are not solved for
        blocks[:, range(3), range(3)] += empty
        self._inverse.data[:] = np.linalg.inv(blocks)[self._where]

    def solve(self, r: Float32Array) -> Float32Array:
        """(n,) of every block by itself."""
        out: Float32Array = self._inverse @ r
        return out


class _Coarse:
    """Factor of the linear element's matrix, whose structure stays where its upper triangle's does."""

    def __init__(self, upper: sp.csr_matrix) -> None:
        self._pattern = Pattern(upper.shape[0], upper.indptr.astype(np.int32), upper.indices.astype(np.int32), ())
        self.solver: SymmetricSolver = make_direct(self._pattern)

    def fits(self, upper: sp.csr_matrix) -> bool:
        """Whether this structure is that of another upper triangle."""
        return np.array_equal(upper.indptr, self._pattern.indptr) and np.array_equal(
            upper.indices, self._pattern.indices
        )

    def factorise(self, upper: sp.csr_matrix) -> None:
        """Raises FactorisationError."""
        self.solver.factorise(upper.data.astype(np.float64))

    def solve(self, r: Float32Array) -> Float32Array:
        """(c,) roughly."""
        return self.solver.solve_roughly(r.astype(np.float64)).astype(np.float32)
