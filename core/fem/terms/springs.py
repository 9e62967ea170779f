"""Linear springs between points of the body and their targets."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.terms.base import PointSet


@dataclass(frozen=True, eq=False)
class Springs:
    """Energy sum_q 1/2 measure_q (v_q - load target_q) . S_q (v_q - load target_q).

    target : (q, 3) mm. stiffness : (3, 3) or (q, 3, 3), kPa/mm when `points.measure` is an area, mN/mm when it is 1.
    """

    points: PointSet
    stiffness: FloatArray
    target: FloatArray

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return self.points.unknowns

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        gap = self.points.displacements(u) - load * self.target
        S = np.broadcast_to(self.stiffness, (len(gap), 3, 3)) * self.points.measure[:, None, None]
        force = np.einsum("qij,qj->qi", S, gap)
        k = 3 * self.points.nodes.shape[1]
        tangent = self.points.spread_tangent(S) if order >= 2 else np.zeros((0, k, k))
        return 0.5 * float((force * gap).sum()), self.points.spread(force), tangent
