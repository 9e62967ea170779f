"""What the better element adds to the quick one's residual, as a function of ln G: a defect correction of first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class ElementCorrection:
    """value (n,) : added to the residual at theta (t,). slope (n, t) : its derivative in theta there; no columns where it
    is the same at every theta.

    Away from theta the change follows a hyperbolic tangent. What an equilibrium gains by a further step of ln G fades
    where a region is much softer or stiffer than what surrounds it, where a straight line would go on.
    """

    theta: FloatArray
    value: FloatArray
    slope: FloatArray

    @classmethod
    def none(cls, n: int) -> ElementCorrection:
        """Nothing, at every theta, for n data."""
        return cls(np.zeros(0), np.zeros(n), np.zeros((n, 0)))

    @classmethod
    def stacked(cls, each: Sequence[ElementCorrection]) -> ElementCorrection:
        """Corrections of several states, one after the other; all of them at the same theta."""
        value, slope = np.concatenate([c.value for c in each]), np.vstack([c.slope for c in each])
        return cls(each[0].theta, value, slope)

    def at(self, theta: FloatArray) -> FloatArray:
        """Correction (n,) at theta (t,)."""
        if not self.slope.shape[1]:
            return self.value
        return np.asarray(self.value + self.slope @ np.tanh(theta - self.theta))

    def in_theta(self, theta: FloatArray) -> FloatArray:
        """Derivative (n, t) of `at` at theta (t,)."""
        if not self.slope.shape[1]:
            return np.zeros((len(self.value), len(theta)))
        return np.asarray(self.slope / np.cosh(theta - self.theta) ** 2)

    def with_value(self, value: FloatArray, theta: FloatArray) -> ElementCorrection:
        """Another value (n,) at another theta (t,), changing as before."""
        return replace(self, value=value, theta=theta if self.slope.shape[1] else self.theta)

    def of(self, rows: slice) -> ElementCorrection:
        """That of some rows."""
        return replace(self, value=self.value[rows], slope=self.slope[rows])
