"""Dead loads: nodal forces, tractions and body forces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.fem.space import Space
from palpate.core.fem.terms.base import PointSet, face_points


@dataclass(frozen=True, eq=False)
class PointForce:
    """Dead forces (q, 3) mN at points."""

    points: PointSet
    force: FloatArray

    @property
    def unknowns(self) -> IntArray:
        """See `Term.unknowns`."""
        return self.points.unknowns

    def evaluate(self, u: FloatArray, load: float, order: int) -> tuple[float, FloatArray, FloatArray]:
        """See `Term.evaluate`."""
        energy = -load * float((self.force * self.points.displacements(u)).sum())
        gradient = self.points.spread(-load * self.force)
        k = gradient.shape[1]
        return energy, gradient, np.zeros((len(gradient), k, k)) if order >= 2 else np.zeros((0, k, k))


def nodal_force(nodes: IntArray, force: FloatArray) -> PointForce:
    """Forces (n, 3) mN at nodes (n,)."""
    nodes = np.asarray(nodes, dtype=np.int64)[:, None]
    return PointForce(PointSet(nodes, np.ones(nodes.shape), np.ones(len(nodes))), np.asarray(force, dtype=float))


def traction(space: Space, faces: IntArray, t: FloatArray) -> PointForce:
    """Dead traction t (3,) or per face (f, 3), kPa per rest area, on faces (f, 3) of the mesh."""
    points = face_points(space.nodes, space.face_nodes(faces))
    per_point = np.repeat(np.broadcast_to(np.asarray(t, dtype=float), (len(faces), 3)), 3, axis=0)
    return PointForce(points, points.measure[:, None] * per_point)


def body_force(space: Space, b: FloatArray, regions: tuple[int, ...] | None = None) -> PointForce:
    """Dead body force b (3,) or per cell (m, 3), kPa/mm (rho g of water: 9.81e-3 kPa/mm), in the given regions or
    everywhere.
    """
    e = space.element
    chosen = (
        np.arange(len(space.mesh.cells)) if regions is None else np.flatnonzero(np.isin(space.mesh.regions, regions))
    )
    q = len(e.weights)
    points = PointSet(
        np.repeat(space.cell_nodes[chosen], q, axis=0),
        np.tile(e.N, (len(chosen), 1)),
        (space.mesh.volumes[chosen, None] * e.weights).ravel(),
    )
    per_cell = np.broadcast_to(np.asarray(b, dtype=float), (len(space.mesh.cells), 3))[chosen]
    return PointForce(points, points.measure[:, None] * np.repeat(per_cell, q, axis=0))
