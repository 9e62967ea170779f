"""Compiled evaluation of tricubic B-splines with exact derivatives and straight continuation beyond the grid."""

from __future__ import annotations

import numpy as np
from numba import njit

from palpate.core.arrays import FloatArray, IntArray


@njit(cache=True, error_model="numpy")
def evaluate(
    coefficients: FloatArray,
    origin: FloatArray,
    scale: float,
    x: FloatArray,
    value: FloatArray,
    gradient: FloatArray,
    hessian: FloatArray,
) -> None:
    """Fill value (q,), gradient (q, 3) and, when it has rows, hessian (q, 3, 3) at x (q, 3); scale = 1 / spacing.

    Beyond the grid d(x) = d(c) + grad d(c) . (x - c), c the closest point of the grid's box; the derivatives given are
    exactly those of this continuation.
    """
    weights = np.empty((3, 4, 4))
    start = np.empty(3, dtype=np.int64)
    beyond = np.empty(3)
    moments = np.empty((4, 4, 4))
    second = hessian.shape[0] > 0
    for q in range(x.shape[0]):
        if not (np.isfinite(x[q, 0]) and np.isfinite(x[q, 1]) and np.isfinite(x[q, 2])):
            value[q] = np.nan
            gradient[q] = np.nan
            if second:
                hessian[q] = np.nan
            continue
        outside = False
        for k in range(3):
            last = coefficients.shape[k] - 3
            t = (x[q, k] - origin[k]) * scale
            inside = min(max(t, 0.0), float(last))
            beyond[k] = t - inside
            outside = outside or beyond[k] != 0.0
            start[k] = min(int(inside), last - 1)
            basis(inside - start[k], weights[k])
        order = (2 if second else 1) + (1 if outside else 0)
        contract(coefficients, start, weights, order, moments)
        value[q] = moments[0, 0, 0]
        for i in range(3):
            first = derivative(moments, i, -1, -1)
            value[q] += first * beyond[i]
            gradient[q, i] = first * scale
            if outside and beyond[i] == 0.0:
                for k in range(3):
                    if beyond[k] != 0.0:
                        gradient[q, i] += derivative(moments, i, k, -1) * beyond[k] * scale
        if second:
            second_derivatives(moments, beyond, outside, scale, hessian[q])


@njit(cache=True, error_model="numpy")
def second_derivatives(moments: FloatArray, beyond: FloatArray, outside: bool, scale: float, out: FloatArray) -> None:
    """Second derivatives (3, 3) of the continued spline."""
    for i in range(3):
        for j in range(3):
            if beyond[i] != 0.0 and beyond[j] != 0.0:
                out[i, j] = 0.0
                continue
            h = derivative(moments, i, j, -1)
            if outside and beyond[i] == 0.0 and beyond[j] == 0.0:
                for k in range(3):
                    if beyond[k] != 0.0:
                        h += derivative(moments, i, j, k) * beyond[k]
            out[i, j] = h * scale * scale


@njit(cache=True, error_model="numpy")
def derivative(moments: FloatArray, i: int, j: int, k: int) -> float:
    """The moment that holds the derivative along axes i, j, k (-1: none)."""
    a = (i == 0) + (j == 0) + (k == 0)
    b = (i == 1) + (j == 1) + (k == 1)
    c = (i == 2) + (j == 2) + (k == 2)
    return moments[a, b, c]


@njit(cache=True, error_model="numpy")
def contract(coefficients: FloatArray, start: IntArray, weights: FloatArray, order: int, moments: FloatArray) -> None:
    """moments[a, b, c] = derivative of orders a, b, c along the axes, in grid units, for a + b + c <= order."""
    moments[: order + 1, : order + 1, : order + 1] = 0.0
    for i in range(4):
        for j in range(4):
            for c in range(order + 1):
                along = 0.0
                for k in range(4):
                    along += weights[2, c, k] * coefficients[start[0] + i, start[1] + j, start[2] + k]
                for b in range(order + 1 - c):
                    plane = weights[1, b, j] * along
                    for a in range(order + 1 - c - b):
                        moments[a, b, c] += weights[0, a, i] * plane


@njit(cache=True, error_model="numpy")
def basis(t: float, out: FloatArray) -> None:
    """out[d, k] = d-th derivative of the k-th of the four cubic B-splines at t in [0, 1] of a cell."""
    s = 1.0 - t
    out[0, 0], out[0, 3] = s * s * s / 6.0, t * t * t / 6.0
    out[0, 1], out[0, 2] = (4.0 - 3.0 * t * t * (2.0 - t)) / 6.0, (4.0 - 3.0 * s * s * (2.0 - s)) / 6.0
    out[1, 0], out[1, 3] = -0.5 * s * s, 0.5 * t * t
    out[1, 1], out[1, 2] = 0.5 * t * (3.0 * t - 4.0), -0.5 * s * (3.0 * s - 4.0)
    out[2, 0], out[2, 1], out[2, 2], out[2, 3] = s, 3.0 * t - 2.0, 3.0 * s - 2.0, t
    out[3, 0], out[3, 1], out[3, 2], out[3, 3] = -1.0, 3.0, -3.0, 1.0
