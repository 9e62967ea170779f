"""Follower pressure: it stays normal to the deformed surface and acts on its deformed area."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import triangle_quadrature


@dataclass(frozen=True, eq=False)
class FollowerPressure:
    """Pressure (kPa, positive pushes against the outward normal) on faces of the mesh.

    Its energy is pressure times the volume swept, 1/3 sum x . n da: a potential when the surface is closed or its
    border does not move, and only then is the tangent symmetric. The Assembler refuses surfaces with a free border:
    `refusal`. nodes : (n, 3) rest coordinates mm.
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

    def refusal(self, free: BoolArray) -> str | None:
        """Why this load has no energy under these constraints (free (3 n,)), or None when it has one."""
        sides = [[0, 1], [1, 2], [2, 0]] if self.face_nodes.shape[1] == 3 else [[0, 1, 3], [1, 2, 4], [2, 0, 5]]
        edges = self.face_nodes[:, sides].reshape(-1, len(sides[0]))
        _, inverse, counts = np.unique(np.sort(edges[:, :2], axis=1), axis=0, return_inverse=True, return_counts=True)
        border = np.unique(edges[counts[inverse.ravel()] == 1])
        loose = int(np.asarray(free).reshape(-1, 3)[border].any(axis=1).sum())
        if loose == 0:
            return None
        return (
            f"a follower pressure acts on a surface whose open border has {loose} nodes that can move: such a load has no "
            "energy; close the surface or hold its border"
        )

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        x = (self.nodes + u)[self.face_nodes]
        rest = self.nodes[self.face_nodes]
        N, dN, weights = _face_shapes(self.face_nodes.shape[1])
        p = 0.5 * load * self.pressure  # dx/ds x dx/dt counts the area twice
        a, b = (np.einsum("qk,fki->fqi", dN[:, :, d], x) for d in (0, 1))
        normal = np.cross(a, b)
        wN = weights[:, None] * N
        force = p * np.einsum("qk,fqi->fki", wN, normal)
        energy = p * (_volume(wN, dN, x) - _volume(wN, dN, rest))
        n, k = len(x), 3 * x.shape[1]
        if order < 2:
            return energy, force.reshape(n, k), np.zeros((0, k, k))
        K = np.einsum("qa,qb,fqij->faibj", wN, dN[:, :, 0], -_cross_matrix(b), optimize=True)
        K = K + np.einsum("qa,qb,fqij->faibj", wN, dN[:, :, 1], _cross_matrix(a), optimize=True)
        K = p * K.reshape(n, k, k)
        return energy, force.reshape(n, k), 0.5 * (K + np.swapaxes(K, 1, 2))


def _volume(wN: FloatArray, dN: FloatArray, x: FloatArray) -> float:
    """Twice the volume between faces (f, k, 3) and the origin."""
    normal = np.cross(*(np.einsum("qk,fki->fqi", dN[:, :, d], x) for d in (0, 1)))
    return float(np.einsum("qk,fki,fqi->", wN, x, normal)) / 3.0


def _cross_matrix(v: FloatArray) -> FloatArray:
    """M with M w = v x w, for v (..., 3)."""
    M = np.zeros((*v.shape, 3))
    M[..., 0, 1], M[..., 0, 2], M[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return M - np.swapaxes(M, -1, -2)


def _face_shapes(n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Shape functions (q, n), derivatives (q, n, 2) and weights (q,) of 3- or 6-node faces, exact; node order of
    `face_nodes`.
    """
    L, weights = triangle_quadrature(2 if n == 3 else 4)
    dL = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    if n == 3:
        return L, np.broadcast_to(dL, (len(L), 3, 2)).copy(), weights
    a, b = np.array([0, 1, 2]), np.array([1, 2, 0])
    N = np.hstack([L * (2 * L - 1), 4 * L[:, a] * L[:, b]])
    vertex = (4 * L - 1)[:, :, None] * dL
    edge = 4 * (L[:, a, None] * dL[b] + L[:, b, None] * dL[a])
    return N, np.concatenate([vertex, edge], axis=1), weights
