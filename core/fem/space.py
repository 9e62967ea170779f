"""The discrete space of one mesh and element: nodes, unknowns and the geometry of the cells."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError
from palpate.core.fem.elements import EDGES, ELEMENTS, Element, shape_functions
from palpate.core.mesh import TetMesh


@dataclass(frozen=True, eq=False)
class Space:
    """Displacement nodes (vertices, then mid-edges) and pressure unknowns of a mesh.

    nodes : (n, 3) mm. cell_nodes : (m, 4 or 10). cell_pressures : (m, np), numbered apart in every region, because the
    pressure jumps where the stiffness does. Unknown 3 a + i is component i of node a; pressures follow.
    """

    mesh: TetMesh
    element: Element
    nodes: FloatArray
    cell_nodes: IntArray
    cell_pressures: IntArray
    n_pressures: int

    @classmethod
    def of(cls, mesh: TetMesh, element: str) -> Space:
        """Raises InputError when the element's name is unknown."""
        if element not in ELEMENTS:
            raise InputError(f"element '{element}' is unknown; choose one of {', '.join(ELEMENTS)}")
        e = ELEMENTS[element]
        nodes, cell_nodes = mesh.points, mesh.cells
        if e.degree == 2:
            edges, inverse = np.unique(
                np.sort(mesh.cells[:, EDGES], axis=2).reshape(-1, 2), axis=0, return_inverse=True
            )
            nodes = np.vstack([nodes, mesh.points[edges].mean(axis=1)])
            cell_nodes = np.hstack([mesh.cells, len(mesh.points) + inverse.reshape(-1, 6)])
        pressures, n_pressures = _number_pressures(mesh, e)
        return cls(mesh, e, np.ascontiguousarray(nodes), np.ascontiguousarray(cell_nodes), pressures, n_pressures)

    @property
    def n_nodes(self) -> int:
        """Number of displacement nodes."""
        return len(self.nodes)

    @property
    def n_displacements(self) -> int:
        """Number of displacement unknowns, 3 per node."""
        return 3 * len(self.nodes)

    @property
    def edge_ends(self) -> IntArray:
        """(n - vertices, 2) ends of the edge that each node behind the vertices halves; none for linear elements."""
        vertices = len(self.mesh.points)
        ends = np.empty((self.n_nodes - vertices, 2), dtype=np.int64)
        ends[self.cell_nodes[:, 4:].ravel() - vertices] = self.mesh.cells[:, EDGES].reshape(-1, 2)[
            : self.cell_nodes[:, 4:].size
        ]
        return ends

    @cached_property
    def inverse_jacobians(self) -> FloatArray:
        """(m, 3, 3) dxi/dX of the straight-sided cells, 1/mm."""
        X = self.mesh.points[self.mesh.cells]
        return np.asarray(np.linalg.inv(np.swapaxes(X[:, 1:] - X[:, :1], 1, 2)), dtype=np.float64)

    @cached_property
    def face_nodes_by_vertices(self) -> dict[tuple[int, int], int]:
        """Mid-edge node of each edge (low vertex, high vertex); empty for linear elements."""
        if self.element.degree == 1:
            return {}
        pairs = np.sort(self.mesh.cells[:, EDGES], axis=2).reshape(-1, 2)
        return {(a, b): n for (a, b), n in zip(pairs.tolist(), self.cell_nodes[:, 4:].ravel().tolist(), strict=True)}

    def face_nodes(self, faces: IntArray) -> IntArray:
        """Nodes (f, 3 or 6) of faces (f, 3) given by vertices; mid-edges in the order 01, 12, 20."""
        if self.element.degree == 1:
            return faces
        table = self.face_nodes_by_vertices
        mid = [
            [table[tuple(sorted((int(f[a]), int(f[b]))))] for a, b in ((0, 1), (1, 2), (2, 0))]  # type: ignore[index]
            for f in faces
        ]
        return np.hstack([faces, np.array(mid, dtype=np.int64).reshape(-1, 3)])

    def interpolation(self, points: FloatArray, regions: tuple[int, ...] | None = None) -> sp.csr_matrix:
        """Matrix (p, n) that takes nodal values to points (p, 3) mm.

        Points outside the (chosen regions of the) mesh take the polynomial of the nearest cell, continued: a curved
        surface lies a little outside its straight-sided cells.
        """
        cell, xi = locate(self.mesh, points, regions)
        values = shape_functions(self.element.degree, xi)
        rows = np.repeat(np.arange(len(points)), values.shape[1])
        columns = self.cell_nodes[cell].ravel()
        return sp.csr_matrix((values.ravel(), (rows, columns)), shape=(len(points), self.n_nodes))


# Cells that are asked whether they hold a point, nearest centres first: most points are in one of a few, by
# more than rounding.
_NEAREST, _WITHIN_MM = (6, 40), 1e-9


def locate(mesh: TetMesh, points: FloatArray, regions: tuple[int, ...] | None = None) -> tuple[IntArray, FloatArray]:
    """For points (p, 3): the cell (p,) that holds each or is nearest in barycentric measure, and reference coordinates
    (p, 3).
    """
    chosen = np.arange(len(mesh.cells)) if regions is None else np.flatnonzero(np.isin(mesh.regions, regions))
    if len(chosen) == 0:
        raise InputError(f"mesh has no cell in regions {regions}")
    X = mesh.points[mesh.cells[chosen]]
    inverse = np.linalg.inv(np.swapaxes(X[:, 1:] - X[:, :1], 1, 2))
    # Depth outside a cell in mm, not in barycentric units: large cells must not win over near ones.
    height = 1.0 / np.linalg.norm(np.concatenate([inverse, inverse.sum(axis=1, keepdims=True)], axis=1), axis=2)
    tree = cKDTree(X.mean(axis=1))
    cell, at = np.empty(len(points), dtype=np.int64), np.empty((len(points), 3))
    left = np.arange(len(points))
    for k in _NEAREST:
        count = min(k, len(chosen))
        near = tree.query(points[left], k=count)[1].reshape(len(left), count)
        xi = np.einsum("pkij,pkj->pki", inverse[near], points[left, None] - X[near, 0])
        lowest = (np.concatenate([xi, 1.0 - xi.sum(axis=2, keepdims=True)], axis=2) * height[near]).min(axis=2)
        best = np.argmax(lowest, axis=1)
        row = np.arange(len(left))
        cell[left], at[left] = chosen[near[row, best]], xi[row, best]
        left = left[lowest[row, best] < _WITHIN_MM]
    return cell, at


def _number_pressures(mesh: TetMesh, element: Element) -> tuple[IntArray, int]:
    if element.pressure == "none":
        return np.zeros((len(mesh.cells), 0), dtype=np.int64), 0
    if element.pressure == "cell":
        return np.arange(len(mesh.cells), dtype=np.int64)[:, None], len(mesh.cells)
    _, region = np.unique(mesh.regions, return_inverse=True)
    keys = region[:, None] * len(mesh.points) + mesh.cells
    unique, inverse = np.unique(keys, return_inverse=True)
    return inverse.reshape(-1, 4), len(unique)
