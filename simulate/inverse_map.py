"""Where each point of a deformed body was at rest: what lets a deformed CT be as crisp as the one at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.simulate.wall_motion import WallMotion

# A quadratic cell as eight linear ones; nodes 4 to 9 are the mid-edges 01, 12, 02, 03, 13, 23.
EIGHT = np.array(
    [
        [0, 4, 6, 7],
        [4, 1, 5, 8],
        [6, 5, 2, 9],
        [7, 8, 9, 3],
        [4, 5, 6, 8],
        [4, 6, 7, 8],
        [6, 5, 9, 8],
        [6, 9, 7, 8],
    ]
)
_NEWTON_STEPS = 12
_ENOUGH_MM = 1e-4


class QuadraticCells(Protocol):
    """Cells of ten nodes: corners, then the mid-edges 01, 12, 02, 03, 13, 23."""

    @property
    def nodes(self) -> FloatArray:
        """(n, 3) mm at rest."""

    @property
    def cell_nodes(self) -> IntArray:
        """(m, 10)."""


@dataclass(frozen=True, eq=False)
class BackwardMap:
    """Rest positions of points of the deformed body.

    In the mesh they are interpolated on its deformed cells; in a hollow organ they solve x + u(x) = y with that organ's
    own motion; bone and all beyond the modelled region stay where they are.

    space, u : mesh of quadratic cells and displacement (n, 3) mm of its nodes. boundary : name -> its nodes. motions : of walls.
    """

    space: QuadraticCells
    u: FloatArray
    boundary: Mapping[str, IntArray]
    motions: Mapping[str, WallMotion]

    def rest_points(self, points: FloatArray) -> FloatArray:
        """Rest positions (n, 3) mm of points (n, 3) mm of the deformed body."""
        points = np.asarray(points, dtype=np.float64)
        result = points.copy()
        low, high = self._box
        near = np.flatnonzero(((points > low) & (points < high)).all(axis=1))
        if len(near) == 0:
            return result
        found = pv.PolyData(points[near]).sample(self._deformed, tolerance=1e-6, snap_to_closest_point=False)
        held = np.asarray(found["vtkValidPointMask"], dtype=bool)
        result[near[held]] = np.asarray(found["rest"], dtype=np.float64)[held]
        self._fill_hollows(points, near[~held], result)
        return result

    def _fill_hollows(self, points: FloatArray, left: NDArray[np.intp], result: FloatArray) -> None:
        """Points that no cell holds belong to the body whose deformed surface is nearest."""
        if len(left) == 0 or not self.motions:
            return
        _, nearest = self._surface_tree.query(points[left])
        owner = self._surface_owner[nearest]
        for number, name in enumerate(self.boundary):
            if name in self.motions:
                mine = left[owner == number]
                result[mine] = undo(self.motions[name], points[mine])

    @cached_property
    def _deformed(self) -> pv.UnstructuredGrid:
        corners = self.space.cell_nodes[:, EIGHT].reshape(-1, 4)
        grid = pv.UnstructuredGrid({pv.CellType.TETRA: corners}, self.space.nodes + self.u)
        grid.point_data["rest"] = self.space.nodes
        return grid

    @cached_property
    def _box(self) -> tuple[FloatArray, FloatArray]:
        deformed = self.space.nodes + self.u
        return deformed.min(axis=0), deformed.max(axis=0)

    @cached_property
    def _surface_tree(self) -> cKDTree:
        deformed = self.space.nodes + self.u
        return cKDTree(np.concatenate([deformed[nodes] for nodes in self.boundary.values()]))

    @cached_property
    def _surface_owner(self) -> IntArray:
        return np.repeat(np.arange(len(self.boundary)), [len(nodes) for nodes in self.boundary.values()])


def undo(motion: WallMotion, points: FloatArray) -> FloatArray:
    """Solve x + u(x) = y for points y (n, 3) mm by Newton's method with a difference quotient; steps are at most 3 mm."""
    x = points - motion.displacement(points)
    active = np.arange(len(points))
    for _ in range(_NEWTON_STEPS):
        if len(active) == 0:
            break
        here = x[active]
        gap = points[active] - here - motion.displacement(here)
        step = np.linalg.solve(_jacobian(motion, here), gap[:, :, None])[:, :, 0]
        length = np.linalg.norm(step, axis=1, keepdims=True)
        x[active] = here + step * np.minimum(1.0, 3.0 / np.maximum(length, 1e-12))
        active = active[np.linalg.norm(gap, axis=1) > _ENOUGH_MM]
    return x


def _jacobian(motion: WallMotion, x: FloatArray, step_mm: float = 0.02) -> FloatArray:
    """I + du/dx (n, 3, 3)."""
    columns = [
        (motion.displacement(x + move) - motion.displacement(x - move)) / (2.0 * step_mm)
        for move in step_mm * np.eye(3)
    ]
    return np.eye(3) + np.stack(columns, axis=2)
