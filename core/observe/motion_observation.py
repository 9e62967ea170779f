"""Motion that the images tell, compared with the one that a model predicts."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.fem.space import Space, locate
from palpate.core.matched_motion import MatchedMotion
from palpate.core.observe.motion_rows import MotionRows, mode_reader

# A point outside the mesh by more than this share of its nearest cell is no datum. Points that are looked for at once.
_OUTSIDE, _AT_ONCE = 0.2, 20_000


@dataclass(frozen=True, eq=False)
class MotionObservation:
    """rows : of what lies in the mesh. operator : (p, n) takes nodal displacements to the rows' nodes. reader : (m, d)
    takes the rows to their modes, whose errors are independent and of unit variance."""

    rows: MotionRows
    operator: sp.csr_matrix
    reader: FloatArray

    @classmethod
    def of(cls, matched: MatchedMotion | None, space: Space, reader: FloatArray | None = None) -> MotionObservation:
        """What lies in the mesh; no data where nothing was matched. reader : where it is known already."""
        if matched is None or len(matched.points) == 0:
            return cls.empty(space.n_nodes)
        rows = MotionRows.of(matched, lambda points: _in_mesh(space, points))
        return cls(rows, _interpolation(space, rows.nodes), mode_reader(rows) if reader is None else reader)

    @classmethod
    def empty(cls, nodes: int = 0) -> MotionObservation:
        """No data, on a space of so many nodes."""
        return cls(MotionRows.none(), sp.csr_matrix((0, nodes)), np.zeros((0, 0)))

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
        if not self.n:
            return MotionObservation.empty(space.n_nodes)
        return replace(self, operator=_interpolation(space, self.rows.nodes))

    def showing(self, motions: FloatArray) -> MotionObservation:
        """The same data, read so that nothing that they show of nodal motions (k, n, 3) mm is lost."""
        if not self.n:
            return self
        shown = np.stack([self.rows.predicted(self.operator @ motion) for motion in motions], axis=1)
        return replace(self, reader=mode_reader(self.rows, shown))

    def residual(self, u: FloatArray) -> FloatArray:
        """Predicted minus matched motion (m,), in the modes, for nodal displacements u (n, 3) mm."""
        return self.residual_of(self.operator @ u)

    def residual_of(self, v: FloatArray) -> FloatArray:
        """The same (m,) for displacements v (p, 3) mm of the rows' nodes."""
        return self.modes_of(v) - np.asarray(self.reader @ self.rows.value)

    def modes_of(self, v: FloatArray) -> FloatArray:
        """Modes (m,) of displacements v (p, 3) mm of the rows' nodes."""
        return np.asarray(self.reader @ self.rows.predicted(v))

    @property
    def per_place(self) -> FloatArray:
        """Derivative (m, w, 3) of the modes in the displacement about each of the rows' places, as if it were the same wherever
        a row looks."""
        d, w = len(self.rows.value), len(self.rows.places)
        of_place = sp.csr_matrix((np.ones(d), (self.rows.place, np.arange(d))), shape=(w, d))
        each = [of_place @ (self.reader * self.rows.as_a_whole[:, a]).T for a in range(3)]
        return np.stack([e.T for e in each], axis=2)

    @property
    def per_node(self) -> FloatArray:
        """Derivative (m, n, 3) of the modes in nodal displacements: made for a passing use, hundreds of megabytes on a fine element."""
        onto = self.rows.response @ sp.kron(self.operator, sp.eye(3), format="csr")
        return np.asarray((onto.T @ self.reader.T).T.reshape(self.n, self.operator.shape[1], 3))

    def jacobian(self, sensitivities: FloatArray) -> FloatArray:
        """Derivative (m, t) of the residual, per unit of theta, for sensitivities du/dtheta (t, n, 3)."""
        if not len(sensitivities):
            return np.zeros((self.n, 0))
        return np.stack([self.modes_of(self.operator @ s) for s in sensitivities], axis=1)


def _in_mesh(space: Space, points: FloatArray) -> BoolArray:
    each = [locate(space.mesh, part)[1] for part in _parts(points)]
    xi = np.vstack(each) if each else np.zeros((0, 3))
    return np.asarray(np.minimum(xi.min(axis=1), 1.0 - xi.sum(axis=1)) > -_OUTSIDE)


def _interpolation(space: Space, points: FloatArray) -> sp.csr_matrix:
    if not len(points):
        return sp.csr_matrix((0, space.n_nodes))
    return sp.vstack([space.interpolation(part) for part in _parts(points)]).tocsr()


def _parts(points: FloatArray) -> list[FloatArray]:
    return np.array_split(points, 1 + len(points) // _AT_ONCE)
