"""An interface between two sets of regions, cut open so that its two sides share no nodes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import IntArray
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class SplitInterface:
    """A mesh whose faces between two sets of regions were opened: every node there exists twice.

    mesh : the opened mesh. inner, outer : (f, 3) the same faces seen by the two sides, vertex by vertex.
    """

    mesh: TetMesh
    inner: IntArray
    outer: IntArray


def open_interface(mesh: TetMesh, inner_regions: tuple[int, ...]) -> SplitInterface:
    """Duplicate the nodes on the faces between `inner_regions` and the rest. Raises InputError when there is no such
    face.
    """
    inside = np.isin(mesh.regions, inner_regions)
    faces, _ = mesh.region_boundary(inner_regions)
    outer_nodes = np.unique(mesh.cells[~inside])
    shared = np.isin(faces, outer_nodes).all(axis=1)
    outside_faces, _ = mesh.region_boundary(tuple(np.unique(mesh.regions[~inside]).tolist()))
    keys = {tuple(sorted(f)) for f in outside_faces.tolist()}
    shared &= np.array([tuple(sorted(f)) in keys for f in faces.tolist()], dtype=bool)
    if not shared.any():
        raise InputError(f"regions {inner_regions} share no face with the rest of the mesh")
    faces = faces[shared]
    nodes = np.intersect1d(np.unique(mesh.cells[inside]), outer_nodes)
    twin = np.arange(len(mesh.points))
    twin[nodes] = len(mesh.points) + np.arange(len(nodes))
    cells = mesh.cells.copy()
    cells[inside] = twin[cells[inside]]
    opened = TetMesh(np.vstack([mesh.points, mesh.points[nodes]]), cells, mesh.regions)
    return SplitInterface(opened, twin[faces], faces)
