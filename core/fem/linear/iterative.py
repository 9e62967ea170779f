"""Iterative solver of mixed systems [[K, B], [B', -C]], for meshes whose factor would take too long and too much memory.

GMRES (Saad & Schultz 1986, SIAM J. Sci. Stat. Comput. 7:856) with a block-triangular preconditioner (Elman, Silvester & Wathen 2014,
Finite Elements and Fast Iterative Solvers, 4.1): a two-level cycle for K, and for the pressures' Schur complement what the pressures' own
block offers. Force and volume are scaled to compare. Where it does not converge, or where K by itself does not tell the inertia, the
matrix is factorised after all.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.sparse import linalg

from palpate.core.arrays import FloatArray
from palpate.core.fem.linear.direct import make_direct
from palpate.core.fem.linear.direct_solver import FactorisationError, SymmetricSolver, check_finite
from palpate.core.fem.linear.pardiso import symmetric_product
from palpate.core.fem.linear.pattern import Pattern
from palpate.core.fem.linear.two_level import Levels, TwoLevel

# Relative residuals, scaled, at which a rough solve and one to round-off end; kept directions, and how often they are begun anew.
_ROUGH, _EXACT = 1e-3, 1e-12
_DIRECTIONS, _RESTARTS = 90, 3
# More right-hand sides than this, to round-off, take longer one by one than a factor (tests/benchmarks/iterative_solver.py).
_MANY = 2
# Conjugate gradients of K by a random vector end at this; curvatures up to there tell whether K is positive definite.
_CURVATURE_TOLERANCE, _CURVATURE_STEPS = 1e-6, 60


class Iterative:
    """See `SymmetricSolver`. schur : b -> about (C + B' K^-1 B)^-1 b over the pressures; to be set before the first solve."""

    name = "iterative"
    schur: Callable[[FloatArray], FloatArray]

    def __init__(self, pattern: Pattern, levels: Levels) -> None:
        self._pattern, self._n = pattern, len(levels.nodes)
        self.factorisations = 0
        # Positions from 1: sums of sparse matrices drop zeros.
        positions = np.arange(1, len(pattern.indices) + 1)
        where = sp.csr_matrix((positions, pattern.indices, pattern.indptr), shape=(pattern.n, pattern.n))
        upper = where[: self._n, : self._n]
        full = (upper + sp.triu(upper, 1).T).tocsr()
        full.data -= 1
        self._two_level = TwoLevel(full, levels)
        coupling = where[: self._n, self._n :].tocsr()
        self._take_coupling = coupling.data - 1
        self._coupling = sp.csr_matrix(
            (np.zeros(coupling.nnz), coupling.indices, coupling.indptr), shape=coupling.shape
        )
        self._diagonal = pattern.indptr[: self._n]  # columns ascend from the diagonal on
        self._values: FloatArray | None = None
        self._direct: SymmetricSolver | None = None
        self._scale = np.ones(pattern.n)
        self._definite: bool | None = None

    def factorise(self, values: FloatArray) -> None:
        """See `SymmetricSolver.factorise`: makes the preconditioner of the matrix."""
        check_finite(values)
        self.factorisations += 1
        self._values, self._direct, self._definite = None, None, None
        self._two_level.set(values)
        self._coupling.data[:] = values[self._take_coupling]
        stiffness = np.maximum(np.abs(values[self._diagonal]), 1e-300)
        volume = self._coupling.multiply(self._coupling).T @ (1.0 / stiffness)  # diagonal of B' diag(K)^-1 B
        self._scale[: self._n] = 1.0 / np.sqrt(stiffness.mean())
        self._scale[self._n :] = 1.0 / np.sqrt(max(float(np.mean(volume)), 1e-300)) if len(volume) else 1.0
        self._values = values

    def solve(self, b: FloatArray) -> FloatArray:
        """See `SymmetricSolver.solve`."""
        if self._values is not None and np.ndim(b) == 2 and np.shape(b)[1] > _MANY:
            return self._factor().solve(b)
        return self._solved(b, _EXACT)

    def solve_roughly(self, b: FloatArray) -> FloatArray:
        """See `SymmetricSolver.solve_roughly`."""
        return self._solved(b, _ROUGH)

    def n_negative(self) -> int:
        """See `SymmetricSolver.n_negative`: one for every pressure where K is positive definite; else that of a factor."""
        if self._values is None:
            raise FactorisationError("n_negative was called before factorise")
        if self._direct is None and self._is_definite():
            return self._pattern.n - self._n
        return self._factor().n_negative()

    def _solved(self, b: FloatArray, tolerance: float) -> FloatArray:
        if self._values is None:
            raise FactorisationError("solve was called before factorise")
        columns = np.asarray(b, dtype=float).reshape(self._pattern.n, -1)
        out = np.empty_like(columns)
        for k, column in enumerate(columns.T):
            found = self._iterated(column, tolerance) if self._direct is None else None
            out[:, k] = self._factor().solve(column) if found is None else found
        return out.reshape(np.shape(b))

    def _iterated(self, b: FloatArray, tolerance: float) -> FloatArray | None:
        """Solution (n,); None where the iteration does not reach the tolerance."""
        scaled = self._scale * b
        if not scaled.any():
            return np.zeros_like(b)
        shape = (len(b), len(b))
        matrix = linalg.LinearOperator(shape, matvec=self._product, dtype=np.float64)
        guide = linalg.LinearOperator(shape, matvec=self._preconditioned, dtype=np.float64)
        y, failed = linalg.gmres(matrix, scaled, rtol=tolerance, restart=_DIRECTIONS, maxiter=_RESTARTS, M=guide)
        return None if failed or not np.isfinite(y).all() else self._scale * y

    def _product(self, y: FloatArray) -> FloatArray:
        assert self._values is not None
        x = (self._scale * np.ravel(y))[None]
        return self._scale * symmetric_product(self._pattern.indptr, self._pattern.indices, self._values, x)[0]

    def _preconditioned(self, r: FloatArray) -> FloatArray:
        """[[K, B], [0, -S]]^-1 r with K and S as they are approximated."""
        force, volume = np.split(np.ravel(r) / self._scale, [self._n])
        p = -self.schur(volume)
        u = self._two_level.apply(force - self._coupling @ p)
        return np.concatenate([u, p]) / self._scale

    def _is_definite(self) -> bool:
        """Whether K is positive definite, by the curvatures that conjugate gradients of a random vector meet.

        An eigenvalue below zero lies apart from the preconditioned others, which are near 1; the iteration cannot end before it has
        met it. A definite K has as many negative eigenvalues in the whole matrix as there are pressures (Sylvester's law: C is definite).
        """
        if self._definite is None:
            self._definite = not self._two_level.falls and self._only_positive_curvature()
        return self._definite

    def _only_positive_curvature(self) -> bool:
        K, apply = self._two_level.matrix, self._two_level.apply
        residual = np.random.default_rng(1).normal(size=self._n)
        z = apply(residual)
        direction, size = z, float(residual @ z)
        goal = _CURVATURE_TOLERANCE**2 * size
        for _ in range(_CURVATURE_STEPS):
            if not size > 0.0:
                return False
            if size <= goal:
                return True
            image = (K @ direction.astype(np.float32)).astype(np.float64)
            curvature = float(direction @ image)
            if not curvature > 0.0:
                return False
            residual = residual - (size / curvature) * image
            z = apply(residual)
            following = float(residual @ z)
            direction, size = z + (following / size) * direction, following
        return False

    def _factor(self) -> SymmetricSolver:
        """Of the present matrix, made when it is first asked for."""
        assert self._values is not None
        if self._direct is None:
            self._direct = make_direct(self._pattern)
            self._direct.factorise(self._values)
        return self._direct
