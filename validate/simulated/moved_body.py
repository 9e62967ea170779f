"""Both directions of a motion that finite elements give: from rest to the deformed state, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pyvista as pv
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.simulate.inverse_map import EIGHT, BackwardMap, QuadraticCells
from palpate.simulate.wall_motion import WallMotion

# Nodes of a wall whose displacements give that of a point beside it, by the inverse square of their distance.
_NEIGHBOURS = 4


@dataclass(frozen=True, eq=False)
class ForwardMap:
    """Displacement of points at rest, the other way round of a `BackwardMap`: by the cells that hold them; just outside by the motion of
    the wall that is nearest, and where there is none by the nearest node."""

    back: BackwardMap

    def displacement(self, points: FloatArray) -> FloatArray:
        """(n, 3) mm of points (n, 3) mm at rest."""
        points = np.asarray(points, dtype=np.float64)
        found = pv.PolyData(points).sample(self._at_rest, tolerance=1e-6, snap_to_closest_point=False)
        u, held = np.asarray(found["u"], dtype=np.float64).copy(), np.asarray(found["vtkValidPointMask"], dtype=bool)
        left = np.flatnonzero(~held)
        if len(left):
            u[left] = self.back.u[cKDTree(self.back.space.nodes).query(points[left])[1]]
            nearest, names = self._walls.query(points[left])[1], list(self.back.boundary)
            for number, name in enumerate(names):
                mine = left[self._owner[nearest] == number]
                if name in self.back.motions and len(mine):
                    u[mine] = self.back.motions[name].displacement(points[mine])
        return u

    @cached_property
    def _at_rest(self) -> pv.UnstructuredGrid:
        corners = self.back.space.cell_nodes[:, EIGHT].reshape(-1, 4)
        grid = pv.UnstructuredGrid({pv.CellType.TETRA: corners}, self.back.space.nodes)
        grid.point_data["u"] = self.back.u
        return grid

    @cached_property
    def _walls(self) -> cKDTree:
        return cKDTree(np.concatenate([self.back.space.nodes[nodes] for nodes in self.back.boundary.values()]))

    @cached_property
    def _owner(self) -> IntArray:
        return np.repeat(np.arange(len(self.back.boundary)), [len(nodes) for nodes in self.back.boundary.values()])


@dataclass(frozen=True, eq=False)
class WallNodes:
    """A wall's motion by its nodes', which is the motion of what lies near it. nodes : (k, 3) mm at rest. u : (k, 3) mm."""

    nodes: FloatArray
    u: FloatArray

    def displacement(self, points: FloatArray) -> FloatArray:
        """See `WallMotion.displacement`."""
        distance, nearest = self._tree.query(points, k=_NEIGHBOURS)
        weight = 1.0 / np.maximum(distance, 1e-3) ** 2
        weight /= weight.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("nk,nki->ni", weight, self.u[nearest]))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.nodes)


def wall_nodes(space: QuadraticCells, u: FloatArray, boundary: Mapping[str, IntArray]) -> dict[str, WallMotion]:
    """Motions of the hollow organs by their walls' nodes. boundary : name -> nodes."""
    return {
        name: WallNodes(space.nodes[boundary[name]], u[boundary[name]])
        for name in ("bladder", "rectum")
        if name in boundary
    }
