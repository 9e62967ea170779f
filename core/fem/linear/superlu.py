"""SciPy's SuperLU in symmetric mode: the fallback everywhere. Pivots stay on the diagonal, so U's signs are the
inertia.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from palpate.core.arrays import FloatArray
from palpate.core.fem.linear.direct_solver import FactorisationError, check_finite
from palpate.core.fem.linear.pattern import Pattern


class SuperLU:
    """See `SymmetricSolver`; analyses anew at every factorisation, since SciPy offers no other way."""

    name = "superlu"

    def __init__(self, pattern: Pattern) -> None:
        self._pattern = pattern
        self.factorisations = 0
        self._lu: spla.SuperLU | None = None

    def factorise(self, values: FloatArray) -> None:
        """See `SymmetricSolver.factorise`."""
        check_finite(values)
        self.factorisations += 1
        upper = self._pattern.matrix(values)
        full = (upper + sp.triu(upper, 1).T).tocsc()
        options = {"SymmetricMode": True}
        try:
            self._lu = spla.splu(full, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        except RuntimeError as error:  # SciPy's word for an exactly singular matrix
            raise FactorisationError(str(error)) from error

    def solve(self, b: FloatArray) -> FloatArray:
        """See `SymmetricSolver.solve`."""
        if self._lu is None:
            raise FactorisationError("solve was called before factorise")
        return self._lu.solve(np.asarray(b, dtype=float))

    def solve_roughly(self, b: FloatArray) -> FloatArray:
        """See `SymmetricSolver.solve_roughly`."""
        return self.solve(b)

    def n_negative(self) -> int:
        """See `SymmetricSolver.n_negative`."""
        if self._lu is None:
            raise FactorisationError("no factor yet")
        return int((self._lu.U.diagonal() < 0.0).sum())
