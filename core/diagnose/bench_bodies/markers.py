"""Motion of markers with the body: those on it take its displacement, those off it sit on something rigid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.fem.space import Space
from palpate.core.surfaces.distance_field import signed_distance
from palpate.core.surfaces.triangle_tree import TriangleTree

# A marker off the body moves rigidly with the material around the node nearest to it, within this, mm; in a
# small body within this share of the cube root of its volume.
_HOLDER_MM, _HOLDER_SHARE = 12.0, 0.3
# A marker within this share of a cell's edge of the surface is on the body: there the element's own displacement,
# continued, is as good as within the cell.
_ON_BODY = 0.25


@dataclass(frozen=True, eq=False)
class Markers:
    """Markers of one state on a space. off_body (k,) : which sit on a holder.

    operator (k, n) takes nodal displacements to markers on the body. holders : of the others, in their order.
    """

    off_body: BoolArray
    operator: sp.csr_matrix
    holders: Sequence[Holder]

    @classmethod
    def of(cls, space: Space, points: FloatArray) -> Markers:
        """Markers at points (k, 3) mm of the body at rest."""
        faces = space.mesh.boundary[0]
        tree = TriangleTree.of(space.mesh.points, faces)
        volumes = space.mesh.volumes
        edge = float((6.0 * np.sqrt(2.0) * volumes.mean()) ** (1.0 / 3.0))
        off = signed_distance(tree, points) > _ON_BODY * edge
        reach = min(_HOLDER_MM, _HOLDER_SHARE * float(volumes.sum()) ** (1.0 / 3.0))
        holders = [Holder.of(space.nodes, x, reach) for x in points[off]]
        return cls(off, space.interpolation(points), holders)

    def motion(self, u: FloatArray) -> FloatArray:
        """Motion (k, 3) mm for nodal displacements u (n, 3) mm."""
        out = np.asarray(self.operator @ u)
        for k, holder in zip(np.flatnonzero(self.off_body), self.holders, strict=True):
            out[k] = holder.motion(u)
        return out

    def change(self, u: FloatArray, move: FloatArray) -> FloatArray:
        """Change (k, 3) mm of the motion, to first order, when the displacements u (n, 3) mm change by move (n, 3)."""
        out = np.asarray(self.operator @ move)
        for k, holder in zip(np.flatnonzero(self.off_body), self.holders, strict=True):
            out[k] = holder.change(u, move)
        return out


@dataclass(frozen=True, eq=False)
class Holder:
    """Rigid holder of one marker, fixed to the nodes around its foot.

    nodes (q,) : of the foot. arms (q, 3) mm : from their centre to them. arm (3,) mm : to the marker.
    """

    nodes: IntArray
    arms: FloatArray
    arm: FloatArray

    @classmethod
    def of(cls, X: FloatArray, at: FloatArray, reach: float) -> Holder:
        """Holder of a marker at (3,) mm, among nodes X (n, 3) mm.

        The foot's nodes lie within `reach` of the node nearest to the marker; the nearest five where there are fewer.
        """
        nearest = X[int(np.argmin(np.linalg.norm(X - at, axis=1)))]
        distance = np.linalg.norm(X - nearest, axis=1)
        nodes = np.flatnonzero(distance <= max(reach, float(np.partition(distance, 4)[4])))
        centre = X[nodes].mean(axis=0)
        return cls(nodes, X[nodes] - centre, at - centre)

    def motion(self, u: FloatArray) -> FloatArray:
        """Motion (3,) mm of the marker: a rigid fit to the foot (Kabsch 1976)."""
        R, _ = self._turned(u)
        return np.asarray(u[self.nodes].mean(axis=0) + R @ self.arm - self.arm)

    def change(self, u: FloatArray, move: FloatArray) -> FloatArray:
        """Its change (3,) mm to first order: M = R S with S symmetric, so that dR = R W with W skew and
        W S + S W = R'dM - dM'R."""
        R, S = self._turned(u)
        dM = move[self.nodes].T @ self.arms
        K = R.T @ dM - dM.T @ R
        axial = np.array([K[2, 1], K[0, 2], K[1, 0]])
        w = np.linalg.solve(np.trace(S) * np.eye(3) - S, axial)
        return np.asarray(move[self.nodes].mean(axis=0) + R @ np.cross(w, self.arm))

    def _turned(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Rotation R (3, 3) of the foot, and S (3, 3) mm2 with M = R S, M = sum of (arm after) (arm before)'."""
        M = (self.arms + u[self.nodes]).T @ self.arms
        U, s, Vt = np.linalg.svd(M)
        sign = np.array([1.0, 1.0, np.sign(np.linalg.det(U @ Vt))])
        R = (U * sign) @ Vt
        return R, np.asarray((Vt.T * (s * sign)) @ Vt)
