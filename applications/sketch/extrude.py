"""A plane figure to a solid: its outline extruded to a slab and meshed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pyvista as pv
from vtkmodules.vtkFiltersGeneral import vtkContourTriangulator

from palpate.applications.sketch.outline import Outline
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.mesh import TetMesh
from palpate.meshing.mesh_solid import PER_CUBE, mesh_solid

# Steps of the outline that is given to the mesher, in edges.
_STEP = 0.5


def mesh_figure(outline: Outline, part_at: Callable[[FloatArray], IntArray], cells: int) -> TetMesh:
    """About `cells` tetrahedra of a slab one edge thick, along z from 0; regions are 1 + what `part_at` says at centres (m, 2).

    Raises ConvergenceError when the outline cannot be filled or meshed.
    """
    edge = float(np.sqrt(PER_CUBE * outline.area / cells))
    points, faces = _slab(outline.resampled(_STEP * edge), edge)
    mesh = mesh_solid(points, faces, cells)
    regions = 1 + part_at(mesh.points[mesh.cells].mean(axis=1)[:, :2])
    return TetMesh(mesh.points, mesh.cells, regions)


def _slab(outline: Outline, thickness: float) -> tuple[FloatArray, IntArray]:
    """Points (n, 3) and faces (f, 3) of the closed surface."""
    n = len(outline.points)
    lines = np.column_stack([np.full(n, 2), np.arange(n), outline.following])
    flat = pv.PolyData(np.column_stack([outline.points, np.zeros(n)]), lines=lines.ravel())
    fill = vtkContourTriangulator()
    fill.SetInputData(flat)
    fill.Update()
    front = np.asarray(pv.wrap(fill.GetOutput()).regular_faces, dtype=np.int64).reshape(-1, 3)
    area = _area(outline.points, front)
    if not np.isclose(abs(area), outline.area, rtol=1e-3):
        raise ConvergenceError("the outline cannot be filled: it crosses itself; draw it without loops in the line")
    front = front if area > 0.0 else front[:, ::-1]
    points = np.vstack([np.column_stack([outline.points, np.full(n, z)]) for z in (0.0, thickness)])
    here, there = np.arange(n), outline.following
    sides = np.vstack([np.column_stack([here, there, there + n]), np.column_stack([here, there + n, here + n])])
    return points, np.vstack([front[:, ::-1], front + n, sides])


def _area(x: FloatArray, faces: IntArray) -> float:
    a, b, c = (x[faces[:, k]] for k in range(3))
    return 0.5 * float(((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]).sum())
