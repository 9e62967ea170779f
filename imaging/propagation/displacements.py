"""Displacements along directions that somebody measured, each with its error: what a motion is learnt from."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class Displacements:
    """points (n, 3) mm. directions (n, 3) unit. along_mm (n,) : displacement along it. variance_mm2 (n,) : of errors of each by
    itself. together_mm2 (m, m) : covariance of further errors of the last m of them."""

    points: FloatArray
    directions: FloatArray
    along_mm: FloatArray
    variance_mm2: FloatArray
    together_mm2: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n, n) mm2 of the errors."""
        out = np.diag(self.variance_mm2)
        first = len(out) - len(self.together_mm2)
        out[first:, first:] += self.together_mm2
        return out

    def chosen(self, keep: BoolArray) -> Displacements:
        """Some of them."""
        of_last = keep[len(keep) - len(self.together_mm2) :]
        arrays = (a[keep] for a in (self.points, self.directions, self.along_mm, self.variance_mm2))
        return Displacements(*arrays, self.together_mm2[np.ix_(of_last, of_last)])

    def at_most(self, count: int) -> Displacements:
        """Evenly drawn, at most so many, from those whose errors are each by itself; the same ones each time. All others stay."""
        n = len(self.points) - len(self.together_mm2)
        if n <= count:
            return self
        keep = np.ones(len(self.points), dtype=bool)
        keep[np.random.default_rng(0).permutation(n)[count:]] = False
        return self.chosen(keep)

    def joined(self, other: Displacements) -> Displacements:
        """These, none of whose errors go together, and others behind them."""
        names = ("points", "directions", "along_mm", "variance_mm2")
        both = (np.concatenate([getattr(self, name), getattr(other, name)]) for name in names)
        return Displacements(*both, other.together_mm2)
