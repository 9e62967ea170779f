"""A wall constrained to the surface that the deformed scan shows, free to slide along it.

A scan shows only the normal component of a wall's motion. Each wall point x = X + u keeps its distance from the
surface, d(x) = d_rest(X); its tangential motion is that of least energy. The constraint is linearised at the present
point, n . u = s, imposed by a stiff spring, and linearised again until it is met. Newton on the full constraint would
need its curvature, which contour noise makes large enough for an indefinite tangent.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.terms.base import PointSet
from palpate.core.surfaces.triangles import areas

# x (q, 3) -> signed distance (q,) mm and its gradient (q, 3).
DistanceFunction = Callable[[FloatArray], tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, eq=False)
class SlidingWall:
    """Energy sum_q 1/2 stiffness measure_q (n_q . v_q - load s_q)^2.

    rest : (q, 3) mm rest positions X. distance : signed distance of the deformed surface. offset : (q,) mm, d wanted.
    normal : (q, 3) unit, shift : (q,) mm, the present linearisation. stiffness : kPa/mm.
    """

    points: PointSet
    rest: FloatArray
    distance: DistanceFunction
    offset: FloatArray
    normal: FloatArray
    shift: FloatArray
    stiffness: float

    @classmethod
    def between(
        cls, points: PointSet, rest: FloatArray, at_rest: DistanceFunction, deformed: DistanceFunction, stiffness: float
    ) -> SlidingWall:
        """A wall seen in both scans: `at_rest` and `deformed` are the signed distances of its two surfaces."""
        q = len(rest)
        first = cls(points, rest, deformed, at_rest(rest)[0], np.zeros((q, 3)), np.zeros(q), stiffness)
        return first.linearised_at(np.zeros((q, 3)))

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return self.points.unknowns

    def gaps(self, u: FloatArray) -> FloatArray:
        """Residual of the constraint at each point, d(x) - d_rest(X), (q,) mm."""
        return self.distance(self.rest + self.points.displacements(u))[0] - self.offset

    def linearised(self, u: FloatArray, way: float = 1.0) -> SlidingWall:
        """The same wall linearised at nodal displacements u (n, 3); see `linearised_at`."""
        return self.linearised_at(self.points.displacements(u), way)

    def linearised_at(self, v: FloatArray, way: float = 1.0) -> SlidingWall:
        """The same wall linearised where its points have moved by v (q, 3).

        way : share of the remaining distance to impose, so that a large motion turns the normals in small steps.
        """
        d, gradient = self.distance(self.rest + v)
        length = np.maximum(np.linalg.norm(gradient, axis=1), 1e-6)
        normal = gradient / length[:, None]
        shift = np.einsum("qi,qi->q", normal, v) - way * (d - self.offset) / np.maximum(length, 0.5)
        return replace(self, normal=normal, shift=shift)

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        gap = np.einsum("qi,qi->q", self.normal, self.points.displacements(u)) - load * self.shift
        w = self.stiffness * self.points.measure
        gradient = self.points.spread((w * gap)[:, None] * self.normal)
        k = 3 * self.points.nodes.shape[1]
        if order < 2:
            return 0.5 * float(w @ gap**2), gradient, np.zeros((0, k, k))
        H = (w[:, None] * self.normal)[:, :, None] * self.normal[:, None, :]
        return 0.5 * float(w @ gap**2), gradient, self.points.spread_tangent(H)


def wall_points(face_nodes: IntArray, nodes: FloatArray) -> PointSet:
    """The nodes of a wall's faces (f, 3 or 6) themselves, each with an equal share of its faces' rest area, mm2.

    One point per node constrains each node's normal once; more quadrature points than nodes would resist sliding along
    a curved surface.
    """
    area = areas(nodes[face_nodes[:, :3]])
    total = np.zeros(len(nodes))
    np.add.at(total, face_nodes, (area / face_nodes.shape[1])[:, None])
    used = np.unique(face_nodes)
    return PointSet(used[:, None], np.ones((len(used), 1)), total[used])
