"""Interpolation of smooth functions of a few parameters from values and gradients, with its own error measure.

A function on [-1, 1]^k that continues analytically a distance around the box has Chebyshev coefficients that fall like
rho^-|m|. The interpolant is the one of least weighted norm sum_m (c_m rho^|m|)^2 that meets the data (a Gaussian
process whose covariance is the kernel sum_m rho^(-2|m|) T_m(x) T_m(y); Wendland 2005, Scattered Data Approximation, ch.
10 and 11). Its power function P(x) bounds the error at x by P(x) times the function's norm; leave-one-out residuals,
which cost nothing, give the norm.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from palpate.core.arrays import FloatArray, IntArray

# Relative noise of the data, squared: between 1e-10 and 1e-8 nothing changes but the conditioning of the normal matrix.
NOISE = 1e-9
_MAX_DEGREE = 24
_MIN_TERMS = 150
RHOS = (1.4, 1.6, 1.8, 2.0, 2.25, 2.5, 2.75, 3.0, 3.5, 4.0, 5.0)
FIRST_RHO = 2.5


@dataclass(frozen=True, eq=False)
class Features:
    """Weighted Chebyshev products phi_m(x) = rho^-|m| prod_i T_{m_i}(x_i), for |m| <= degree.

    powers : (f, k). rho : decay.
    """

    powers: IntArray
    rho: float

    @classmethod
    def enough_for(cls, n_parameters: int, n_data: int, rho: float) -> Features:
        """As many terms as leave the data room: the least norm then decides, not the degree."""
        degree, wanted = 1, max(_MIN_TERMS, int(1.6 * n_data))
        while degree < _MAX_DEGREE and comb(n_parameters + degree, degree) < wanted:
            degree += 1
        rows = []
        for total in range(degree + 1):
            for chosen in combinations_with_replacement(range(n_parameters), total):
                rows.append(np.bincount(np.array(chosen, dtype=np.int64), minlength=n_parameters))
        return cls(np.array(rows, dtype=np.int64), rho)

    @property
    def weight(self) -> FloatArray:
        """(f,)."""
        return self.rho ** -self.powers.sum(axis=1).astype(float)

    def values(self, x: FloatArray) -> FloatArray:
        """(n, f) at points x (n, k)."""
        T = _chebyshev(x, int(self.powers.max()))
        out = np.tile(self.weight, (len(x), 1))
        for i in range(x.shape[1]):
            out *= T[:, i, self.powers[:, i]]
        return out

    def gradients(self, x: FloatArray) -> FloatArray:
        """(n, k, f) derivatives in each x_i."""
        n, k = x.shape
        degree = int(self.powers.max())
        T, dT = _chebyshev(x, degree), _chebyshev_slopes(x, degree)
        out = np.tile(self.weight, (n, k, 1))
        for i in range(k):
            for j in range(k):
                out[:, j] *= (dT if i == j else T)[:, i, self.powers[:, i]]
        return out

    def rows(self, x: FloatArray, with_gradients: bool) -> FloatArray:
        """(n, 1 or 1 + k, f): value, then gradients, of each point."""
        values = self.values(x)[:, None]
        return np.concatenate([values, self.gradients(x)], axis=1) if with_gradients else values


@dataclass(frozen=True, eq=False)
class Fit:
    """Interpolant of vector data at points x.

    features : basis. coefficients : (f, r). explained : (d, f), orthonormal rows that span what the data fix. left_out
    : (n, r) value predicted without point i minus the value there. left_out_power : (n,) power function there without
    i.
    """

    features: Features
    coefficients: FloatArray
    explained: FloatArray
    left_out: FloatArray
    left_out_power: FloatArray

    def power(self, x: FloatArray) -> FloatArray:
        """P (n,) at points x (n, k), with the data's noise."""
        return power(self.features, self.explained, x)


def power(features: Features, explained: FloatArray, x: FloatArray) -> FloatArray:
    """P (n,) at points x (n, k), see `Fit`."""
    phi = features.values(x)
    prior = (phi**2).sum(axis=1)
    remainder = prior - ((phi @ explained.T) ** 2).sum(axis=1)
    return np.sqrt(np.maximum(remainder, 0.0) + NOISE * prior)


def fit(x: FloatArray, data: FloatArray, rho: float) -> Fit:
    """Fit points x (n, k) with data (n, q, r): values (q = 1), or values and the k gradients (q = 1 + k)."""
    n, q, r = data.shape
    features = Features.enough_for(x.shape[1], n * q, rho)
    B = features.rows(x, q > 1).reshape(n * q, -1)
    scale = np.linalg.norm(B, axis=1)
    B = B / scale[:, None]
    lower = cholesky(B @ B.T + NOISE * np.eye(n * q), lower=True)
    explained = solve_triangular(lower, B, lower=True)
    inner = solve_triangular(lower, data.reshape(n * q, r) / scale[:, None], lower=True)
    alpha = solve_triangular(lower, inner, lower=True, trans=1)
    errors, left_out_power = _leave_one_out(lower, alpha, scale, n, q)
    return Fit(features, explained.T @ inner, explained, errors, left_out_power)


def best_fit(x: FloatArray, data: FloatArray, guess: float | None = None) -> Fit:
    """The fit whose rho leaves the smallest leave-one-out error: all of `RHOS`, or downhill steps from a guess."""
    tried: dict[float, tuple[float, Fit]] = {}

    def error_at(rho: float) -> float:
        if rho not in tried:
            one = fit(x, data, rho)
            tried[rho] = (float((one.left_out**2).sum()), one)
        return tried[rho][0]

    if guess is None:
        return tried[min(RHOS, key=error_at)][1]
    here = min(range(len(RHOS)), key=lambda i: abs(RHOS[i] - guess))
    while True:
        around = [i for i in (here - 1, here, here + 1) if 0 <= i < len(RHOS)]
        best = min(around, key=lambda i: error_at(RHOS[i]))
        if best == here:
            return tried[RHOS[here]][1]
        here = best


def greedy_points(
    candidates: FloatArray, n: int, features: Features, explained: FloatArray | None, with_gradients: bool
) -> IntArray:
    """The n candidates (c, k) that, one after the other, have the largest power function given all before them."""
    remainder = features.values(candidates)
    if explained is not None:
        remainder = remainder - (remainder @ explained.T) @ explained
    chosen: list[int] = []
    known = np.zeros((0, remainder.shape[1])) if explained is None else explained
    for _ in range(n):
        best = int(np.argmax((remainder**2).sum(axis=1)))
        chosen.append(best)
        block = features.rows(candidates[best : best + 1], with_gradients)[0]
        Q, _ = np.linalg.qr((block - (block @ known.T) @ known).T)
        remainder = remainder - (remainder @ Q) @ Q.T
        known = np.vstack([known, Q.T])
    return np.array(chosen, dtype=np.int64)


def _leave_one_out(
    lower: FloatArray, alpha: FloatArray, scale: FloatArray, n: int, q: int
) -> tuple[FloatArray, FloatArray]:
    """Block formula: with point i's q rows left out the prediction misses by inverse_ii^-1 alpha_i (Rippa 1999 for q =
    1).
    """
    root = solve_triangular(lower, np.eye(n * q), lower=True)  # inverse = root^T root
    errors, left_out_power = np.empty((n, alpha.shape[1])), np.empty(n)
    for i in range(n):
        rows = slice(i * q, (i + 1) * q)
        block = np.linalg.inv(root[:, rows].T @ root[:, rows])
        errors[i] = -(block @ alpha[rows])[0] * scale[i * q]
        left_out_power[i] = np.sqrt(max(block[0, 0], NOISE)) * scale[i * q]
    return errors, left_out_power


def _chebyshev(x: FloatArray, degree: int) -> FloatArray:
    """T (n, k, degree + 1)."""
    T = np.ones((*x.shape, degree + 1))
    if degree >= 1:
        T[..., 1] = x
    for d in range(2, degree + 1):
        T[..., d] = 2.0 * x * T[..., d - 1] - T[..., d - 2]
    return T


def _chebyshev_slopes(x: FloatArray, degree: int) -> FloatArray:
    """T' (n, k, degree + 1): T_d' = d U_(d-1)."""
    U = np.ones((*x.shape, degree + 1))
    if degree >= 1:
        U[..., 1] = 2.0 * x
    for d in range(2, degree + 1):
        U[..., d] = 2.0 * x * U[..., d - 1] - U[..., d - 2]
    slopes = np.zeros_like(U)
    slopes[..., 1:] = np.arange(1, degree + 1) * U[..., :-1]
    return slopes
