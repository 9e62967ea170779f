"""Direct solvers for symmetric sparse systems behind one interface: analyse once, factorise often, solve, count signs.

The inertia (number of negative pivots) comes with an LDL^T factor for nothing and tells whether an equilibrium is stable.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Callable
from typing import Protocol

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from numpy.typing import NDArray

from palpate.core.fem.pattern import Pattern

FloatArray = NDArray[np.float64]


class FactorisationError(ArithmeticError):
    """The matrix could not be factorised: singular, or not finite."""


class SymmetricSolver(Protocol):
    """A direct solver bound to one sparsity pattern."""

    name: str

    def factorise(self, values: FloatArray) -> None:
        """Factorise the matrix with these upper-triangle values (nnz,). Raises FactorisationError."""

    def solve(self, b: FloatArray) -> FloatArray:
        """Solution (n,) or (n, r) for right-hand sides b (n,) or (n, r)."""

    def n_negative(self) -> int:
        """Number of negative pivots of the last factor."""


class Pardiso:
    """Intel MKL PARDISO by its phases (11 once, 22 and 33 often), real symmetric indefinite (mtype -2), Bunch-Kaufman."""

    name = "pardiso"

    def __init__(self, pattern: Pattern) -> None:
        # Imported here: the package is absent on machines without MKL, where SuperLU serves.
        from pypardiso import PyPardisoSolver

        self._call = PyPardisoSolver(mtype=-2)._mkl_pardiso
        self._pattern = pattern
        self._handle = np.zeros(64, dtype=np.int64)
        self._iparm = np.zeros(64, dtype=np.int32)
        self._iparm[[0, 1, 7, 9, 20, 34]] = [1, 2, 2, 8, 1, 1]
        self._permutation = np.zeros(pattern.n, dtype=np.int32)
        self._values = np.zeros(len(pattern.indices))
        self._factorised = False
        self._phase(11, np.zeros(pattern.n), np.zeros(pattern.n))
        # A finalizer, not __del__: it also runs in order when the interpreter ends.
        weakref.finalize(self, _release, self._call, self._handle, self._iparm, pattern.n)

    def factorise(self, values: FloatArray) -> None:
        """See `SymmetricSolver.factorise`."""
        if not np.isfinite(values).all():
            raise FactorisationError("the matrix holds a value that is not finite")
        self._values = np.ascontiguousarray(values)
        self._phase(22, np.zeros(self._pattern.n), np.zeros(self._pattern.n))

    def solve(self, b: FloatArray) -> FloatArray:
        """See `SymmetricSolver.solve`."""
        columns = np.ascontiguousarray(np.asarray(b, dtype=float).reshape(self._pattern.n, -1).T)
        x = np.empty_like(columns)
        self._phase(33, columns, x)
        return x.T.reshape(np.shape(b))

    def n_negative(self) -> int:
        """See `SymmetricSolver.n_negative`."""
        return int(self._iparm[22])

    def _phase(self, phase: int, b: FloatArray, x: FloatArray) -> None:
        arrays = (self._values, self._pattern.indptr, self._pattern.indices, self._permutation)
        error = _call_phase(self._call, self._handle, self._iparm, phase, self._pattern.n, arrays, b, x)
        if error != 0:
            raise FactorisationError(f"PARDISO phase {phase} ended with error {error}")


def _call_phase(
    call: Callable[..., None],
    handle: NDArray[np.int64],
    iparm: NDArray[np.int32],
    phase: int,
    n: int,
    arrays: tuple[FloatArray, NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]],
    b: FloatArray,
    x: FloatArray,
) -> int:
    """One call of PARDISO for a real symmetric indefinite matrix; returns its error code."""
    error = ctypes.c_int32(0)
    values, indptr, indices, permutation = arrays
    maxfct, mnum, mtype, step, order, nrhs, silent = (
        ctypes.byref(ctypes.c_int32(v)) for v in (1, 1, -2, phase, n, b.size // max(n, 1), 0)
    )
    call(
        handle.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), maxfct, mnum, mtype, step, order, _doubles(values),
        _integers(indptr), _integers(indices), _integers(permutation), nrhs, _integers(iparm), silent,
        _doubles(b), _doubles(x), ctypes.byref(error),
    )  # fmt: skip
    return int(error.value)


def _release(call: Callable[..., None], handle: NDArray[np.int64], iparm: NDArray[np.int32], n: int) -> None:
    none = np.zeros(1, dtype=np.int32)
    _call_phase(call, handle, iparm, -1, n, (np.zeros(1), none, none, none), np.zeros(n), np.zeros(n))


class SuperLU:
    """SciPy's SuperLU in symmetric mode, the fallback everywhere: pivots stay on the diagonal, so U's signs are the inertia."""

    name = "superlu"

    def __init__(self, pattern: Pattern) -> None:
        self._pattern = pattern
        self._lu: spla.SuperLU | None = None

    def factorise(self, values: FloatArray) -> None:
        """See `SymmetricSolver.factorise`."""
        if not np.isfinite(values).all():
            raise FactorisationError("the matrix holds a value that is not finite")
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

    def n_negative(self) -> int:
        """See `SymmetricSolver.n_negative`."""
        if self._lu is None:
            raise FactorisationError("no factor yet")
        return int((self._lu.U.diagonal() < 0.0).sum())


def _doubles(array: FloatArray) -> ctypes._Pointer[ctypes.c_double]:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def _integers(array: NDArray[np.int32]) -> ctypes._Pointer[ctypes.c_int32]:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))


def make_solver(pattern: Pattern, name: str = "auto") -> SymmetricSolver:
    """A solver by name: "pardiso", "superlu", or "auto" for the first that this machine has."""
    if name == "superlu":
        return SuperLU(pattern)
    try:
        return Pardiso(pattern)
    except (ImportError, OSError):
        if name == "pardiso":
            raise
        return SuperLU(pattern)
