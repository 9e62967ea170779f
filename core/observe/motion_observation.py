"""Motion that the images tell, compared with a predicted one: one datum for each direction that a point tells.

The precision of a point's displacement is rotated to its eigenvectors e_a with standard deviations s_a; a direction
with a large one is no datum. The datum is e_a . (u(X) - u_matched). Windows overlap, so that errors of neighbouring
points go along: with C^(1/2) z for the error of a point, and z a unit field with correlation rho(d) in each axis, the
covariance of data a and b is s_a s_b (e_a . e_b) rho(d_ab), which is positive definite as rho is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial.distance import cdist

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.space import Space, locate
from palpate.core.matched_motion import MatchedMotion

# Directions with a larger standard deviation, mm, are no data: they know less than the model before it sees anything.
LARGEST_SD_MM = 3.0
# A point outside the mesh by more than this share of its nearest cell is no datum.
_OUTSIDE = 0.2
# Independent part of every datum's error, as a share of its standard deviation: keeps the covariance well conditioned
# where points nearly coincide.
_NUGGET = 0.1


@dataclass(frozen=True, eq=False)
class MotionObservation:
    """points : (p, 3) mm at rest; moved (p, 3) mm. operator : (p, n) takes nodal displacements to them.

    point : (d,) the point that each datum is of. direction : (d, 3) unit vectors. sd : (d,) mm. correlation_mm : see
    `MatchedMotion`.
    """

    points: FloatArray
    moved: FloatArray
    operator: sp.csr_matrix
    point: IntArray
    direction: FloatArray
    sd: FloatArray
    correlation_mm: float

    @classmethod
    def of(cls, matched: MatchedMotion | None, space: Space) -> MotionObservation:
        """The points that lie in the mesh; no data where nothing was matched."""
        if matched is None or len(matched.points) == 0:
            none, empty = np.zeros(0), np.zeros((0, 3))
            operator = sp.csr_matrix((0, space.n_nodes))
            return cls(empty, empty, operator, np.zeros(0, dtype=np.int64), empty, none, 1.0)
        inside = _in_mesh(space, matched.points)
        points, precision = matched.points[inside], matched.precision[inside]
        value, vector = np.linalg.eigh(precision)
        point, axis = np.nonzero(value > LARGEST_SD_MM**-2)
        return cls(
            points,
            matched.moved[inside],
            space.interpolation(points),
            point,
            vector[point, :, axis],
            1.0 / np.sqrt(value[point, axis]),
            matched.correlation_mm,
        )

    @property
    def n(self) -> int:
        """Number of data."""
        return len(self.sd)

    def on(self, space: Space) -> MotionObservation:
        """The same data, read on another space."""
        if not len(self.points):
            return replace(self, operator=sp.csr_matrix((0, space.n_nodes)))
        return replace(self, operator=space.interpolation(self.points))

    def residual(self, u: FloatArray) -> FloatArray:
        """Predicted minus matched motion (d,) mm, for nodal displacements u (n, 3) mm."""
        return self._along((self.operator @ u) - self.moved)

    def jacobian(self, sensitivities: FloatArray) -> FloatArray:
        """Derivative (d, t) of the residual, mm per unit of theta, for sensitivities du/dtheta (t, n, 3)."""
        if not len(sensitivities):
            return np.zeros((self.n, 0))
        return np.stack([self._along(self.operator @ s) for s in sensitivities], axis=1)

    def covariance(self) -> FloatArray:
        """Covariance (d, d) mm2 of the matched motion's errors."""
        at = self.points[self.point]
        together = np.exp(-((cdist(at, at) / self.correlation_mm) ** 2)) * (self.direction @ self.direction.T)
        together = (1.0 - _NUGGET**2) * together
        together[np.diag_indices_from(together)] = 1.0
        return np.asarray(self.sd[:, None] * together * self.sd)

    def _along(self, at_points: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("di,di->d", at_points[self.point], self.direction))


def _in_mesh(space: Space, points: FloatArray) -> BoolArray:
    _, xi = locate(space.mesh, points)
    return np.asarray(np.minimum(xi.min(axis=1), 1.0 - xi.sum(axis=1)) > -_OUTSIDE)
