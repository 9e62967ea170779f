"""What every direct solver for symmetric sparse systems offers: analyse once, factorise often, solve, count signs.

The inertia (number of negative pivots) comes with an LDL^T factor for nothing and tells whether an equilibrium is
stable.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from palpate.core.arrays import FloatArray


class FactorisationError(ArithmeticError):
    """The matrix could not be factorised: singular, or not finite."""


class SymmetricSolver(Protocol):
    """A direct solver bound to one sparsity pattern; it holds the factor of one matrix at a time.

    factorisations : number of matrices factorised so far. It tells whether the factor is still that of a given matrix.
    """

    name: str
    factorisations: int

    def factorise(self, values: FloatArray) -> None:
        """Factorise the matrix with these upper-triangle values (nnz,), which must not change later. Raises
        FactorisationError.
        """

    def solve(self, b: FloatArray) -> FloatArray:
        """Solution (n,) or (n, r) for right-hand sides b (n,) or (n, r), to round-off. Raises FactorisationError
        without a factor.
        """

    def solve_roughly(self, b: FloatArray) -> FloatArray:
        """The same to about five digits, in less time: for steps of an iteration that corrects itself."""

    def n_negative(self) -> int:
        """Number of negative pivots of the last factor."""


def check_finite(values: FloatArray) -> None:
    """Raises FactorisationError when a value is not finite."""
    if not np.isfinite(values).all():
        raise FactorisationError("the matrix holds a value that is not finite")
