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
        together = self.together_mm2[np.ix_(of_last, of_last)]
        return Displacements(
            self.points[keep], self.directions[keep], self.along_mm[keep], self.variance_mm2[keep], together
        )

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
        return Displacements(
            np.concatenate([self.points, other.points]),
            np.concatenate([self.directions, other.directions]),
            np.concatenate([self.along_mm, other.along_mm]),
            np.concatenate([self.variance_mm2, other.variance_mm2]),
            other.together_mm2,
        )
