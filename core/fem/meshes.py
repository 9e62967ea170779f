"""Deterministic conforming meshes of simple bodies: boxes, a sphere in a cube, a thick sphere. For studies, benchmarks
and tests.

All are made of hexahedra split into six tetrahedra each; a face's diagonal starts at its vertex of lowest index
(Dompierre et al. 1999, How to subdivide pyramids, prisms and hexahedra into tetrahedra), so neighbours agree whatever
the block they come from.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import TetMesh, cell_volumes

ORGAN, TISSUE = 1, 3

# Vertices of a hexahedron are numbered x + 2 y + 4 z; each face goes round once.
_HEX_FACES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])


def split_hexahedra(points: FloatArray, hexahedra: IntArray, regions: IntArray) -> TetMesh:
    """Conforming tetrahedra of hexahedra (h, 8): the cone from the lowest vertex over the triangles of the faces it is
    not on.
    """
    faces = hexahedra[:, _HEX_FACES]
    first = np.argmin(faces, axis=2)
    turned = np.take_along_axis(faces, (first[..., None] + np.arange(4)) % 4, axis=2)
    triangles = np.stack([turned[..., [0, 1, 2]], turned[..., [0, 2, 3]]], axis=2).reshape(len(hexahedra), 12, 3)
    apex = hexahedra.min(axis=1)
    far = (triangles != apex[:, None, None]).all(axis=2)  # six of twelve triangles do not touch the apex
    cells = np.hstack([np.repeat(apex, 6)[:, None], triangles[far]])
    flipped = cell_volumes(points, cells) < 0.0
    cells[flipped] = cells[flipped][:, [0, 2, 1, 3]]
    return TetMesh(points, cells, np.repeat(regions, 6))


def _grid(shape: tuple[int, int, int]) -> tuple[FloatArray, IntArray]:
    """Points of the unit cube, (n, 3), and hexahedra (h, 8) of a grid of shape[i] cells along i."""
    axes = [np.linspace(0.0, 1.0, n + 1) for n in shape]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    index = np.arange(len(points)).reshape(*(n + 1 for n in shape))
    ends = [(slice(None, -1), slice(1, None))[b] for b in (0, 1)]
    corners = [index[ends[v & 1], ends[v >> 1 & 1], ends[v >> 2 & 1]].ravel() for v in range(8)]
    return points, np.stack(corners, axis=1)


def box(lengths: ArrayLike, divisions: tuple[int, int, int], jitter: float = 0.0, seed: int = 0) -> TetMesh:
    """Box [0, lengths] mm of region 1; inner points are moved by up to `jitter` of a cell's size to make the mesh
    irregular.
    """
    points, hexahedra = _grid(divisions)
    if jitter > 0.0:
        inner = np.abs(points - 0.5).max(axis=1) < 0.5 - 1e-9
        move = np.random.default_rng(seed).uniform(-jitter, jitter, size=points.shape) / np.array(divisions)
        points = np.where(inner[:, None], points + move, points)
    points = points * np.asarray(lengths, dtype=float)
    return split_hexahedra(points, hexahedra, np.full(len(hexahedra), ORGAN))


def with_regions(mesh: TetMesh, region_at: Callable[[FloatArray], IntArray]) -> TetMesh:
    """The same cells with the region that `region_at` (m, 3) -> (m,) gives for their centres."""
    return TetMesh(mesh.points, mesh.cells, region_at(mesh.points[mesh.cells].mean(axis=1)))


def sphere_in_cube(n: int, shells: int, layers: int, radius: float = 10.0, half_width: float = 25.0) -> TetMesh:
    """The paper's Fig 7 body: a ball of region 1 in a cube of region 3, both centred at 0; 6 n^2 (n + 6 shells + 6
    layers) cells.

    n : cells along an edge of the inner cube and so a quarter turn of the sphere; shells : layers from the inner cube
    to the sphere; layers : from the sphere to the cube's surface.
    """
    return onion(
        n, [(shells, lambda s, c, d: _core(c, radius) * (1.0 - s) + radius * d * s, ORGAN),
            (layers, lambda s, c, d: radius * d * (1.0 - s**1.3) + half_width * c * s**1.3, TISSUE)],
        lambda c: _core(c, radius),
    )  # fmt: skip


def _core(c: FloatArray, radius: float) -> FloatArray:
    """Inner cube of side ~ radius with bulged faces: points c on [-1, 1]^3 cube to coordinates, between cube and
    ball.
    """
    bulge = 1.0 + 0.25 * (1.0 - (np.linalg.norm(c, axis=1) / np.maximum(np.abs(c).max(axis=1), 1e-12) - 1.0))
    return 0.45 * radius * c * bulge[:, None]


Layer = tuple[int, Callable[[FloatArray, FloatArray, FloatArray], FloatArray], int]


def onion(n: int, layers: list[Layer], core: Callable[[FloatArray], FloatArray] | None) -> TetMesh:
    """Six blocks around a cube, layer upon layer; the cube itself is meshed where `core` maps it, else left hollow.

    A layer maps (s, c, d), s (k, 1) from 0 to 1 outwards, c (k, 3) on the cube's surface and d its direction, to points
    (k, 3).
    """
    points, hexahedra, regions = [], [], []
    offset = 0

    def add(block_points: FloatArray, block: IntArray, region: int) -> None:
        nonlocal offset
        points.append(block_points)
        hexahedra.append(block + offset)
        regions.append(np.full(len(block), region))
        offset += len(block_points)

    if core is not None:
        x, block = _grid((n, n, n))
        add(core(_equiangular(2.0 * x - 1.0)), block, layers[0][2])
    for count, place, region in layers:
        x, block = _grid((n, n, count))
        for axis in range(3):
            for sign in (-1.0, 1.0):
                c = np.empty_like(x)
                c[:, axis] = sign
                c[:, [(axis + 1) % 3, (axis + 2) % 3]] = _equiangular(2.0 * x[:, :2] - 1.0)
                d = c / np.linalg.norm(c, axis=1)[:, None]
                add(place(x[:, 2:], c, d), block, region)
    return _welded(np.vstack(points), np.vstack(hexahedra), np.concatenate(regions))


def _equiangular(x: FloatArray) -> FloatArray:
    """Points of [-1, 1] so that equal steps are equal angles seen from the centre."""
    return np.tan(0.25 * np.pi * x)


def _welded(points: FloatArray, hexahedra: IntArray, regions: IntArray) -> TetMesh:
    """Merge the points that blocks have in common."""
    scale = np.abs(points).max()
    keys = np.round(points / (1e-7 * scale)).astype(np.int64)
    _, first, inverse = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return split_hexahedra(points[first], inverse.ravel()[hexahedra], regions)


def refined(mesh: TetMesh, times: int = 1) -> TetMesh:
    """Each cell in eight by its mid-edges (Bey 1995); the body's shape stays, so that finer solutions measure the
    element alone.
    """
    for _ in range(times):
        mesh = _refined_once(mesh)
    return mesh


def _refined_once(mesh: TetMesh) -> TetMesh:
    pairs = np.array([[0, 1], [1, 2], [0, 2], [0, 3], [1, 3], [2, 3]])
    edges, inverse = np.unique(np.sort(mesh.cells[:, pairs], axis=2).reshape(-1, 2), axis=0, return_inverse=True)
    points = np.vstack([mesh.points, mesh.points[edges].mean(axis=1)])
    nodes = np.hstack([mesh.cells, len(mesh.points) + inverse.reshape(-1, 6)])
    corners = [[0, 4, 6, 7], [4, 1, 5, 8], [6, 5, 2, 9], [7, 8, 9, 3]]
    # The inner octahedron is cut along its shortest diagonal, so that repeated refinement does not flatten cells.
    diagonals = np.array([[4, 9], [5, 7], [6, 8]])
    rings = np.array([[5, 6, 7, 8], [4, 6, 9, 8], [4, 5, 9, 7]])
    length = np.linalg.norm(points[nodes[:, diagonals[:, 0]]] - points[nodes[:, diagonals[:, 1]]], axis=2)
    choice = np.argmin(length, axis=1)
    axis, ring = np.take_along_axis, rings[choice]
    d = axis(nodes, diagonals[choice], axis=1)
    r = axis(nodes, ring, axis=1)
    inner = [np.column_stack([d, r[:, k], r[:, (k + 1) % 4]]) for k in range(4)]
    cells = np.vstack([nodes[:, c] for c in corners] + inner)
    flipped = cell_volumes(points, cells) < 0.0
    cells[flipped] = cells[flipped][:, [0, 2, 1, 3]]
    return TetMesh(points, cells, np.tile(mesh.regions, 8))
