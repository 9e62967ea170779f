"""Follower pressure: it stays normal to the deformed surface and acts on its deformed area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.fem.elements import EDGES
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import FloatArray, IntArray

_POINTS = np.array([[2, 1 / 2, 1 / 2], [1 / 2, 2, 1 / 2], [1 / 2, 1 / 2, 2]]) / 3.0


@dataclass(frozen=True, eq=False)
class FollowerPressure:
    """Pressure (kPa, positive pushes against the outward normal) on faces of the mesh.

    Its energy is pressure times the volume swept, 1/3 sum x . n da: a potential when the surface is closed or its border does not
    move. Then the tangent is symmetric; the symmetric part is returned in any case. nodes : (n, 3) rest coordinates mm.
    """

    nodes: FloatArray
    face_nodes: IntArray
    pressure: float

    @classmethod
    def on(cls, space: Space, faces: IntArray, pressure: float) -> FollowerPressure:
        """On faces (f, 3) of the mesh, outward point order."""
        return cls(space.nodes, space.face_nodes(faces), pressure)

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return (3 * self.face_nodes[:, :, None] + np.arange(3)).reshape(len(self.face_nodes), -1)

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        x = (self.nodes + u)[self.face_nodes]
        rest = self.nodes[self.face_nodes]
        N, dN = _face_shapes(self.face_nodes.shape[1])
        p = load * self.pressure / 3.0  # quadrature weight 1/2 * 1/3 a point, and dx/ds x dx/dt counts the area twice
        half = 0.5
        a, b = (np.einsum("qk,fki->fqi", dN[:, :, d], x) for d in (0, 1))
        normal = np.cross(a, b)
        force = p * half * np.einsum("qk,fqi->fki", N, normal)
        volume = np.einsum("qk,fki,fqi->", N, x, normal) / 3.0 - _volume(N, dN, rest)
        n, k = len(x), 3 * x.shape[1]
        if order < 2:
            return p * half * volume, force.reshape(n, k), np.zeros((0, k, k))
        K = np.einsum("qa,qb,fqij->faibj", N, dN[:, :, 0], -_cross_matrix(b), optimize=True)
        K = K + np.einsum("qa,qb,fqij->faibj", N, dN[:, :, 1], _cross_matrix(a), optimize=True)
        K = p * half * K.reshape(n, k, k)
        return p * half * volume, force.reshape(n, k), 0.5 * (K + np.swapaxes(K, 1, 2))


def _volume(N: FloatArray, dN: FloatArray, x: FloatArray) -> float:
    normal = np.cross(*(np.einsum("qk,fki->fqi", dN[:, :, d], x) for d in (0, 1)))
    return float(np.einsum("qk,fki,fqi->", N, x, normal)) / 3.0


def _cross_matrix(v: FloatArray) -> FloatArray:
    """M with M w = v x w, for v (..., 3)."""
    M = np.zeros((*v.shape, 3))
    M[..., 0, 1], M[..., 0, 2], M[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return M - np.swapaxes(M, -1, -2)


def _face_shapes(n: int) -> tuple[FloatArray, FloatArray]:
    """Shape functions (q, n) and derivatives (q, n, 2) of 3- or 6-node faces at the three points; node order of `face_nodes`."""
    L = _POINTS
    dL = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    if n == 3:
        return L, np.broadcast_to(dL, (3, 3, 2)).copy()
    a, b = EDGES[:3, 0].copy(), EDGES[:3, 1].copy()
    a[2], b[2] = 2, 0
    N = np.hstack([L * (2 * L - 1), 4 * L[:, a] * L[:, b]])
    vertex = (4 * L - 1)[:, :, None] * dL
    edge = 4 * (L[:, a, None] * dL[b] + L[:, b, None] * dL[a])
    return N, np.concatenate([vertex, edge], axis=1)
