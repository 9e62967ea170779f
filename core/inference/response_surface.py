"""Response surface: a residual over a box of parameters, as a polynomial through values and gradients at a few points.

A residual that comes with its gradient tells much per solve (Hermite data): 16 solves for two parameters give a
polynomial of degree 6.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from math import comb

import numpy as np
from numpy.polynomial import chebyshev

from palpate.core.arrays import FloatArray, IntArray

# Unknown coefficients over equations, at most: the rest smooths what is no polynomial.
_LOAD = 0.6


@dataclass(frozen=True, eq=False)
class ResponseSurface:
    """box (t, 2). powers (k, t) : degrees of Chebyshev polynomials. coefficients (k, n) : of the residual."""

    box: FloatArray
    powers: IntArray
    coefficients: FloatArray

    @classmethod
    def of(cls, box: FloatArray, nodes: FloatArray, values: FloatArray, gradients: FloatArray) -> ResponseSurface:
        """Least squares through values (m, n) and gradients (m, n, t) at nodes (m, t) of a box (t, 2)."""
        m, t = nodes.shape
        degree = _degree(m * (t + 1), t)
        powers = np.array([p for p in product(range(degree + 1), repeat=t) if sum(p) <= degree], dtype=np.int64)
        x, half = _in_unit_box(box, nodes), 0.5 * (box[:, 1] - box[:, 0])
        shares = 1.0 / max(degree, 1)  # a polynomial's slope exceeds its size by up to its degree and more
        rows = [_basis(x, powers, None), *(shares * _basis(x, powers, axis) for axis in range(t))]
        right = [values, *(shares * half[axis] * gradients[:, :, axis] for axis in range(t))]
        coefficients = np.linalg.lstsq(np.vstack(rows), np.vstack(right), rcond=None)[0]
        return cls(box, powers, np.asarray(coefficients, dtype=np.float64))

    def at(self, theta: FloatArray) -> FloatArray:
        """Residuals (q, n) at theta (q, t)."""
        return np.asarray(_basis(_in_unit_box(self.box, theta), self.powers, None) @ self.coefficients)


def chebyshev_nodes(box: FloatArray, per_axis: int) -> FloatArray:
    """Chebyshev-Lobatto points (per_axis ** t, t) of a box (t, 2), each next to the one before it."""
    x = -np.cos(np.pi * np.arange(per_axis) / (per_axis - 1))
    t = len(box)
    order = np.array(list(product(range(per_axis), repeat=t)))
    for axis in range(1, t):  # there and back, so that the next point is a neighbour
        turns = order[:, :axis].sum(axis=1) % 2 == 1
        order[turns, axis] = per_axis - 1 - order[turns, axis]
    return np.asarray(box[:, 0] + 0.5 * (1.0 + x[order]) * (box[:, 1] - box[:, 0]))


def _degree(equations: int, t: int) -> int:
    """Largest total degree whose coefficients the equations can determine."""
    degree = 0
    while comb(degree + 1 + t, t) <= _LOAD * equations:
        degree += 1
    return degree


def _in_unit_box(box: FloatArray, theta: FloatArray) -> FloatArray:
    return np.asarray(2.0 * (theta - box[:, 0]) / (box[:, 1] - box[:, 0]) - 1.0)


def _basis(x: FloatArray, powers: IntArray, axis: int | None) -> FloatArray:
    """Basis (q, k) at x (q, t), or its derivative along an axis."""
    out = np.ones((len(x), len(powers)))
    for j in range(x.shape[1]):
        degree = int(powers[:, j].max())
        identity: FloatArray = np.eye(degree + 1)
        if j == axis:
            identity = np.asarray(chebyshev.chebder(identity)) if degree else np.zeros((1, 1))
        out *= chebyshev.chebval(x[:, j], identity)[powers[:, j]].T
    return out
