"""A mesh whose boundary is moved from the voxels' smooth surfaces onto exact ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.mesh import TetMesh, cell_volumes
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import ORGAN_LABELS
from palpate.meshing.mesh_labels import MeshedCase
from palpate.validate.simulated.drawing import Inside, on_contour

# A cell keeps at least this share of its volume: where it would not, its corners go half the way, so often at most.
_LEAST, _ROUNDS = 0.2, 8


def on_contours(meshed: MeshedCase, inside: Mapping[str, Inside]) -> MeshedCase:
    """The same cells with the nodes of organ, bladder, rectum and bone on their contours, those between moved smoothly.

    inside : structure -> whether points (n, 3) mm lie within its contour.
    """
    mesh = meshed.mesh
    faces = dict(meshed.boundary) | {"organ": mesh.region_boundary(ORGAN_LABELS)[0]}
    move, held = np.zeros_like(mesh.points), np.zeros(len(mesh.points), dtype=bool)
    for name in ("bone", "rectum", "bladder", "organ"):
        if name not in faces or name not in inside:
            continue
        nodes = np.unique(faces[name])
        normals = Surface(mesh.points, faces[name], np.zeros(len(faces[name]), dtype=np.int64)).point_normals
        outwards = normals[nodes] if name == "organ" else -normals[nodes]  # a hole's boundary looks into the hole
        move[nodes] = on_contour(mesh.points[nodes], outwards, inside[name]) - mesh.points[nodes]
        held[nodes] = True
    if "outer" in faces:
        edge = np.unique(faces["outer"])
        move[edge], held[edge] = 0.0, True
    for _ in range(_ROUNDS):
        points = mesh.points + _spread(mesh, move, held)
        share = cell_volumes(points, mesh.cells) / mesh.volumes
        flat = share < _LEAST
        if not flat.any():
            break
        move[np.unique(mesh.cells[flat])] *= 0.5
    return MeshedCase(TetMesh(points, mesh.cells, mesh.regions), meshed.boundary, meshed.quality)


def _spread(mesh: TetMesh, move: FloatArray, held: BoolArray) -> FloatArray:
    """Motions (n, 3) of all nodes: given where held, elsewhere the mean of the neighbours'."""
    pairs = mesh.cells[:, [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]].reshape(-1, 2)
    i, j = np.concatenate([pairs, pairs[:, ::-1]]).T
    n = len(mesh.points)
    joined = sparse.csr_matrix((np.ones(len(i)), (i, j)), shape=(n, n))
    joined.data[:] = 1.0
    laplace = (sparse.diags(np.asarray(joined.sum(axis=1)).ravel()) - joined).tocsr()
    out = np.where(held[:, None], move, 0.0)
    free = ~held
    if free.any():
        rhs = -(laplace[free][:, held] @ out[held])
        out[free] = np.asarray(spsolve(laplace[free][:, free].tocsc(), rhs)).reshape(-1, 3)
    return out
