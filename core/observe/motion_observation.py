"""Motion that the images tell, compared with the one that a model predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.fem.space import Space, locate
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.motion_data import MotionData, mode_reader

# A point outside the mesh by more than this share of its nearest cell is no datum.
_OUTSIDE = 0.2


@dataclass(frozen=True, eq=False)
class MotionObservation:
    """data : of the points that lie in the mesh. operator : (p, n) takes nodal displacements to them. reader : (m, d)
    takes the data to their modes, whose errors are independent and of unit variance."""

    data: MotionData
    operator: sp.csr_matrix
    reader: FloatArray

    @classmethod
    def of(cls, matched: MatchedMotion | None, space: Space) -> MotionObservation:
        """The points that lie in the mesh; no data where nothing was matched."""
        if matched is None or len(matched.points) == 0:
            return cls.empty(space.n_nodes)
        data = MotionData.of(matched, _in_mesh(space, matched.points))
        return cls(data, space.interpolation(data.points), mode_reader(data))

    @classmethod
    def empty(cls, nodes: int = 0) -> MotionObservation:
        """No data, on a space of so many nodes."""
        return cls(MotionData.of(None), sp.csr_matrix((0, nodes)), np.zeros((0, 0)))

    @property
    def n(self) -> int:
        """Number of modes."""
        return len(self.reader)

    @property
    def covariance(self) -> FloatArray:
        """Covariance (m, m) of the modes' errors."""
        return np.eye(self.n)

    def on(self, space: Space) -> MotionObservation:
        """The same data, read on another space."""
        if not len(self.data.points):
            return replace(self, operator=sp.csr_matrix((0, space.n_nodes)))
        return replace(self, operator=space.interpolation(self.data.points))

    def residual(self, u: FloatArray) -> FloatArray:
        """Predicted minus matched motion (m,), in the modes, for nodal displacements u (n, 3) mm."""
        return self.residual_of(self.operator @ u)

    def residual_of(self, v: FloatArray) -> FloatArray:
        """The same (m,) for displacements v (p, 3) mm of the points."""
        return self.along(v - self.data.moved)

    def along(self, v: FloatArray) -> FloatArray:
        """Modes (m,) of displacements v (p, 3) mm of the points."""
        return np.asarray(self.reader @ self.data.along(v))

    @property
    def per_point(self) -> FloatArray:
        """Derivative (m, p, 3) of the modes in the points' displacements."""
        out = np.zeros((self.n, len(self.data.points), 3))
        for d, (point, direction) in enumerate(zip(self.data.point, self.data.direction, strict=True)):
            out[:, point] += self.reader[:, d, None] * direction
        return out

    def jacobian(self, sensitivities: FloatArray) -> FloatArray:
        """Derivative (m, t) of the residual, per unit of theta, for sensitivities du/dtheta (t, n, 3)."""
        if not len(sensitivities):
            return np.zeros((self.n, 0))
        return np.stack([self.along(self.operator @ s) for s in sensitivities], axis=1)


def _in_mesh(space: Space, points: FloatArray) -> BoolArray:
    _, xi = locate(space.mesh, points)
    return np.asarray(np.minimum(xi.min(axis=1), 1.0 - xi.sum(axis=1)) > -_OUTSIDE)
