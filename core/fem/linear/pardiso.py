"""Intel MKL PARDISO by its phases (11 once, 22 and 33 often), real symmetric indefinite.

The factor is made in single precision: 0.6 of the time and half the memory of double, and its inertia is the same
unless an eigenvalue is within rounding of zero. Rows and columns are scaled first, so that the largest entry of each is
about 1 (one pass of Ruiz 2001, RAL-TR-2001-034): a wall is a
thousand times as stiff as the tissue, and pivots of pressure unknowns would count as zero beside it. Exact solutions come
from refinement against the double matrix. Where single precision does not do (a perturbed pivot, refinement that stalls)
the factor is made in double.
"""

from __future__ import annotations

import ctypes
import os
import weakref
from collections.abc import Callable
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np
from numba import njit
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray, Int32Array, IntArray
from palpate.core.fem.linear.direct_solver import FactorisationError, check_finite
from palpate.core.fem.linear.pattern import Pattern

_MTYPE = -2
_MKL_PATH = "PYPARDISO_MKL_RT"  # environment variable from which pypardiso takes the library's path
_REFINEMENTS = 6
_EXACT = 1e-13  # relative residual at which refinement ends
_GOOD = 1e-12  # relative residual that refinement must reach


@cache
def mkl_pardiso() -> Callable[..., None]:
    """MKL's entry point. Raises ImportError where there is none."""
    library = _mkl_library()
    if library is not None:
        os.environ.setdefault(_MKL_PATH, library)
    # Imported here: the package is absent on machines without MKL, where SuperLU serves.
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver(mtype=_MTYPE)._mkl_pardiso


def _mkl_library() -> str | None:
    """Path of MKL's run-time library as the wheel `mkl` lists it, None without that wheel.

    Without it pypardiso searches the whole environment, twice: 0.7 to 1.1 s of processor time in every process.
    """
    try:
        listed = metadata.files("mkl") or []
    except metadata.PackageNotFoundError:
        return None
    found = (Path(str(file.locate())) for file in listed if "mkl_rt" in file.name)
    return next((str(path.resolve()) for path in found if path.is_file()), None)


class _Handle:
    """One analysed pattern in one precision."""

    def __init__(self, pattern: Pattern, precision: type[np.floating]) -> None:
        self._call = mkl_pardiso()
        self._pattern = pattern
        self.precision = precision
        self._memory = np.zeros(64, dtype=np.int64)
        self.iparm = np.zeros(64, dtype=np.int32)
        # Own settings, METIS, refinement only after perturbed pivots, pivots perturbed below 1e-8 (1e-13 in double) of
        # the norm, precision, indices from 0.
        single = precision is np.float32
        self.iparm[[0, 1, 9, 27, 34]] = [1, 2, 8 if single else 13, int(single), 1]
        # Pivots from the diagonal and the two-level algorithm, in 0.76 of the time that Bunch-Kaufman pivots take one
        # by one (17,611 unknowns, medians of five pairs): a mixed matrix [[K, B], [B', -C]] with K and C definite has
        # such a factor in any order (Vanderbei 1995, SIAM J. Optim. 5:100). Where it has none, pivots are perturbed and
        # double precision takes over, with Bunch-Kaufman pivots.
        self.iparm[[20, 23]] = [0, 1] if single else [1, 0]
        self._permutation = np.zeros(max(pattern.n, 1), dtype=np.int32)
        self._values = np.zeros(len(pattern.indices), dtype=precision)
        self._scale = np.ones(pattern.n)
        none = np.zeros(pattern.n, dtype=precision)
        self.phase(11, none, none)
        # A finalizer, not __del__: it also runs in order when the interpreter ends.
        weakref.finalize(self, _release, self._call, self._memory, self.iparm, pattern.n)

    def factorise(self, values: FloatArray) -> None:
        """Phase 22. Scaled values are at most 2: PARDISO reads outside its memory once a pivot overflows."""
        indptr, indices = self._pattern.indptr, self._pattern.indices
        self._scale = equilibrated(indptr, indices, values)
        self._values = scaled(indptr, indices, values, self._scale).astype(self.precision, copy=False)
        none = np.zeros(self._pattern.n, dtype=self.precision)
        self.phase(22, none, none)

    def solve(self, columns: FloatArray) -> FloatArray:
        """Phase 33 for right-hand sides (r, n)."""
        right = columns * self._scale
        size = _largest(right)
        b = np.ascontiguousarray(right / size, dtype=self.precision)
        x = np.empty_like(b)
        self.phase(33, b, x)
        return x.astype(np.float64) * (size * self._scale)

    def phase(self, phase: int, b: NDArray[np.floating], x: NDArray[np.floating]) -> None:
        """One call. Raises FactorisationError."""
        arrays = (self._values, self._pattern.indptr, self._pattern.indices, self._permutation)
        error = _call_phase(self._call, self._memory, self.iparm, phase, self._pattern.n, arrays, b, x)
        if error != 0:
            raise FactorisationError(f"PARDISO phase {phase} ended with error {error}")


class Pardiso:
    """See `SymmetricSolver`."""

    name = "pardiso"

    def __init__(self, pattern: Pattern) -> None:
        self._pattern = pattern
        self.factorisations = 0
        self._single = _Handle(pattern, np.float32)
        self._double: _Handle | None = None
        self._current: _Handle | None = None
        self._values: FloatArray = np.zeros(0)

    def factorise(self, values: FloatArray) -> None:
        """See `SymmetricSolver.factorise`."""
        check_finite(values)
        self.factorisations += 1
        self._values = values
        self._current = None
        self._single.factorise(values)
        if self._single.iparm[13] == 0:
            self._current = self._single
        else:
            self._factorise_in_double()

    def solve(self, b: FloatArray) -> FloatArray:
        """See `SymmetricSolver.solve`."""
        columns = np.asarray(b, dtype=float).reshape(self._pattern.n, -1).T
        if self._factor is self._single:
            x, good = self._refined(columns)
            if good:
                return x.T.reshape(np.shape(b))
            self._factorise_in_double()
        return self._factor.solve(columns).T.reshape(np.shape(b))

    def solve_roughly(self, b: FloatArray) -> FloatArray:
        """See `SymmetricSolver.solve_roughly`."""
        columns = np.asarray(b, dtype=float).reshape(self._pattern.n, -1).T
        return self._factor.solve(columns).T.reshape(np.shape(b))

    def n_negative(self) -> int:
        """See `SymmetricSolver.n_negative`."""
        return int(self._factor.iparm[22])

    @property
    def _factor(self) -> _Handle:
        if self._current is None:
            raise FactorisationError("solve was called before factorise")
        return self._current

    def _factorise_in_double(self) -> None:
        self._double = self._double or _Handle(self._pattern, np.float64)
        self._double.factorise(self._values)
        self._current = self._double

    def _refined(self, columns: FloatArray) -> tuple[FloatArray, bool]:
        """Solutions (r, n) by iterative refinement, and whether every one of them is good."""
        pattern, size = self._pattern, np.linalg.norm(columns, axis=1)
        x = self._single.solve(columns)
        before = np.inf
        for _ in range(_REFINEMENTS):
            residual = columns - symmetric_product(pattern.indptr, pattern.indices, self._values, x)
            worst = float((np.linalg.norm(residual, axis=1) / np.maximum(size, 1e-300)).max(initial=0.0))
            if not worst > _EXACT or not worst < 0.5 * before:
                break
            before = worst
            x = x + self._single.solve(residual)
        return x, worst <= _GOOD


def _largest(values: FloatArray) -> float:
    """Power of two at or above the largest magnitude, so that scaling rounds nothing; 1 for zeros."""
    largest = float(np.abs(values).max(initial=0.0))
    return float(np.exp2(np.ceil(np.log2(largest)))) if 0.0 < largest < np.inf else 1.0


@njit(cache=True)
def equilibrated(indptr: Int32Array, indices: Int32Array, values: FloatArray) -> FloatArray:
    """Scales s (n,) for which the largest magnitude of every row of s_i A_ij s_j is about 1, for a matrix given by its
    upper triangle in CSR; 1 for a row of zeros. Powers of two, so that scaling rounds nothing.
    """
    largest = np.zeros(len(indptr) - 1)
    for i in range(len(largest)):
        for s in range(indptr[i], indptr[i + 1]):
            size = abs(values[s])
            largest[i] = max(largest[i], size)
            largest[indices[s]] = max(largest[indices[s]], size)
    for i in range(len(largest)):
        largest[i] = 2.0 ** np.round(-0.5 * np.log2(largest[i])) if largest[i] > 0.0 else 1.0
    return largest


@njit(cache=True)
def scaled(indptr: Int32Array, indices: Int32Array, values: FloatArray, scale: FloatArray) -> FloatArray:
    """Values of scale_i A_ij scale_j, for a matrix given by its upper triangle in CSR."""
    out = np.empty_like(values)
    for i in range(len(indptr) - 1):
        for s in range(indptr[i], indptr[i + 1]):
            out[s] = values[s] * scale[i] * scale[indices[s]]
    return out


def symmetric_product(indptr: Int32Array, indices: Int32Array, values: FloatArray, x: FloatArray) -> FloatArray:
    """A x for rows x (r, n) of a matrix given by its upper triangle in CSR."""
    columns, y = np.ascontiguousarray(x.T), np.zeros((x.shape[1], x.shape[0]))
    _add_product(indptr, indices, values, columns, y)
    return np.ascontiguousarray(y.T)


@njit(cache=True)
def _add_product(indptr: Int32Array, indices: Int32Array, values: FloatArray, x: FloatArray, y: FloatArray) -> None:
    """Add A x to y for x, y (n, r): the matrix is read once for all columns."""
    total = np.empty(x.shape[1])
    for i in range(x.shape[0]):
        total[:] = 0.0
        for s in range(indptr[i], indptr[i + 1]):
            j, value = indices[s], values[s]
            for k in range(x.shape[1]):
                total[k] += value * x[j, k]
            if j != i:
                for k in range(x.shape[1]):
                    y[j, k] += value * x[i, k]
        for k in range(x.shape[1]):
            y[i, k] += total[k]


def _call_phase(
    call: Callable[..., None],
    memory: IntArray,
    iparm: Int32Array,
    phase: int,
    n: int,
    arrays: tuple[NDArray[np.floating], Int32Array, Int32Array, Int32Array],
    b: NDArray[np.floating],
    x: NDArray[np.floating],
) -> int:
    """One call of PARDISO; returns its error code. Its float arguments are void pointers, typed double by the
    wrapper.
    """
    error = ctypes.c_int32(0)
    values, indptr, indices, permutation = arrays
    maxfct, mnum, mtype, step, order, nrhs, silent = (
        ctypes.byref(ctypes.c_int32(v)) for v in (1, 1, _MTYPE, phase, n, b.size // max(n, 1), 0)
    )
    call(
        memory.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), maxfct, mnum, mtype, step, order, _floats(values),
        _integers(indptr), _integers(indices), _integers(permutation), nrhs, _integers(iparm), silent,
        _floats(b), _floats(x), ctypes.byref(error),
    )  # fmt: skip
    return int(error.value)


def _release(call: Callable[..., None], memory: IntArray, iparm: Int32Array, n: int) -> None:
    none = np.zeros(1, dtype=np.int32)
    _call_phase(call, memory, iparm, -1, n, (np.zeros(1), none, none, none), np.zeros(n), np.zeros(n))


def _floats(array: NDArray[np.floating]) -> ctypes._Pointer[ctypes.c_double]:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


def _integers(array: Int32Array) -> ctypes._Pointer[ctypes.c_int32]:
    return array.ctypes.data_as(ctypes.POINTER(ctypes.c_int32))
