"""A closed surface to a tetrahedral mesh of the solid inside it."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import ConvergenceError
from palpate.core.fem.meshes import box
from palpate.core.mesh import TetMesh
from palpate.core.surfaces.distance_field import signed_distance
from palpate.core.surfaces.triangle_tree import TriangleTree
from palpate.core.surfaces.triangles import enclosed_volume
from palpate.meshing.tetwild import Soup, tetrahedralize

# Number of cells where the caller names none; they are meant for quadratic elements.
CELLS = 700
# Cells per unit of volume / edge^3; see `meshing.mesher_input`.
PER_CUBE = 8.5
# Distance by which the mesh may leave the surface, in edges.
_EPSILON = 0.02


def mesh_solid(points: FloatArray, faces: IntArray, cells: int = CELLS, region: int = 1) -> TetMesh:
    """About `cells` tetrahedra of one region inside a closed surface.

    points : (n, 3) mm. faces : (f, 3), all outwards or all inwards.

    Raises ConvergenceError when the mesher fails or leaves nothing inside.
    """
    volume = enclosed_volume(points, faces)
    faces = faces if volume > 0.0 else faces[:, ::-1].copy()
    edge = (PER_CUBE * abs(volume) / cells) ** (1.0 / 3.0)
    low, high = points.min(axis=0) - edge, points.max(axis=0) + edge
    around = box(high - low, (1, 1, 1))
    size = np.full(len(around.points), edge)
    soup = Soup(points, faces, around.points + low, around.cells, size, edge, _EPSILON * edge)
    nodes, tetrahedra = tetrahedralize(soup)
    inside = signed_distance(TriangleTree.of(points, faces), nodes[tetrahedra].mean(axis=1)) < 0.0
    if not inside.any():
        raise ConvergenceError("the mesher left nothing inside the body; look at its surface")
    used, renamed = np.unique(tetrahedra[inside], return_inverse=True)
    kept = renamed.reshape(-1, 4)
    return TetMesh(nodes[used], kept, np.full(len(kept), region))
