"""One conforming tetrahedral mesh of organ and tissue from a label volume."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from palpate.core.mesh import FACES_OF_CELL, TetMesh
from palpate.segmentation.mesh_cells import KEPT, clean_labels, face_neighbours, label_cells
from palpate.segmentation.meshing_quality import describe
from palpate.segmentation.meshing_soup import make_soup
from palpate.segmentation.partition import HOLE_NAMES, OUTSIDE, make_partition
from palpate.segmentation.smooth_field import IntArray
from palpate.segmentation.tetwild import tetrahedralize
from palpate.segmentation.volume import Volume


@dataclass(frozen=True)
class MeshOptions:
    """What mesh is wanted.

    edge_mm : wished edge on the organ's surface. far_factor : edges far away are this much longer at most.
    grading : growth of the edge per mm of distance from the organ.
    """

    edge_mm: float = 5.0
    far_factor: float = 4.0
    grading: float = 0.5


@dataclass(frozen=True, eq=False)
class MeshedCase:
    """A mesh of the organ (regions 1, 2) and the tissue (3), and what its boundary touches.

    boundary : name ("bone", "bladder", "rectum", "outer") -> faces (f, 3), normals out of the mesh; a name that touches
    nothing is absent. quality : figures, ready for JSON.
    """

    mesh: TetMesh
    boundary: dict[str, IntArray]
    quality: dict[str, Any] = field(default_factory=dict)


def mesh_labels(labels: Volume, options: MeshOptions | None = None) -> MeshedCase:
    """Mesh the labels 1, 2, 3 of a volume; bone, bladder, rectum and outside are holes.

    Raises InputError when the labels cannot be meshed, ConvergenceError when the mesher fails.
    """
    options = options or MeshOptions()
    start = time.perf_counter()
    partition = make_partition(labels)
    soup = make_soup(partition, options.edge_mm, options.far_factor, options.grading)
    points, cells = tetrahedralize(soup)
    cell_labels = clean_labels(cells, label_cells(points, cells, partition), len(points))
    meshed = assemble(points, cells, cell_labels)
    quality = describe(meshed.mesh, labels) | {"seconds": time.perf_counter() - start}
    return MeshedCase(meshed.mesh, meshed.boundary, quality)


def assemble(points: np.ndarray, cells: IntArray, cell_labels: IntArray) -> MeshedCase:
    """The mesh of the kept labels and its boundary by the label behind each face."""
    across = face_neighbours(cells)
    kept = np.isin(cell_labels, KEPT)
    used, renumbered = np.unique(cells[kept], return_inverse=True)
    mesh = TetMesh(points[used], renumbered.reshape(-1, 4), cell_labels[kept])
    beyond = np.where(across[kept] >= 0, cell_labels[across[kept]], OUTSIDE)
    faces = mesh.cells[:, FACES_OF_CELL]
    names = HOLE_NAMES | {OUTSIDE: "outer"}
    boundary = {name: faces[beyond == label] for label, name in names.items() if (beyond == label).any()}
    return MeshedCase(mesh, boundary)
