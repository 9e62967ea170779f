"""A wall that must lie on a surface seen in the deformed scan and may slide along it.

Only the normal part of a wall's motion is visible. Each wall point x = X + u is held at the distance from the deformed
surface that it had from the rest surface, d(x) = d_rest(X); along the surface it is free, so mechanics chooses the motion of
least energy. The constraint is a stiff penalty; under partial load the wanted distance goes from the present d(X) to the final one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.core.fem.terms.base import FloatArray, IntArray, PointSet

# x (q, 3) -> signed distance (q,) mm and its gradient (q, 3).
DistanceFunction = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class SlidingWall:
    """Energy sum_q 1/2 stiffness measure_q (d(X_q + v_q) - offset_q)^2.

    rest : (q, 3) mm rest positions X. distance : signed distance of the deformed surface. offset : (q,) mm, wanted at full load.
    start : (q,) mm, d(X): wanted at no load. stiffness : kPa/mm.
    """

    points: PointSet
    rest: FloatArray
    distance: DistanceFunction
    offset: FloatArray
    start: FloatArray
    stiffness: float

    @classmethod
    def between(
        cls, points: PointSet, rest: FloatArray, at_rest: DistanceFunction, deformed: DistanceFunction, stiffness: float
    ) -> SlidingWall:
        """A wall seen in both scans: `at_rest` and `deformed` are the signed distances of its two surfaces."""
        return cls(points, rest, deformed, at_rest(rest)[0], deformed(rest)[0], stiffness)

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return self.points.unknowns

    def gaps(self, u: FloatArray, load: float = 1.0) -> FloatArray:
        """(q,) mm, what is left of the constraint."""
        return self.distance(self.rest + self.points.displacements(u))[0] - self._wanted(load)

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        d, normal = self.distance(self.rest + self.points.displacements(u))
        gap = d - self._wanted(load)
        w = self.stiffness * self.points.measure
        gradient = self.points.spread((w * gap)[:, None] * normal)
        k = 3 * self.points.nodes.shape[1]
        if order < 2:
            return 0.5 * float(w @ gap**2), gradient, np.zeros((0, k, k))
        # Without gap times the distance's curvature: the gap vanishes at the solution, and far from it that part is indefinite.
        H = w[:, None, None] * normal[:, :, None] * normal[:, None, :]
        return 0.5 * float(w @ gap**2), gradient, self.points.spread_tangent(H)

    def _wanted(self, load: float) -> FloatArray:
        return (1.0 - load) * self.start + load * self.offset
