"""How good a tetrahedral mesh is, and how well it follows the labels."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.mesh import FACES_OF_CELL, TetMesh
from palpate.core.surfaces.triangles import normals
from palpate.imaging.volume import Volume

SLIVER_DEG = 10.0


class RegionFigures(TypedDict):
    """Of one region: cells, volume of its cells and of its labels' voxels in mm3, and by what share the first is off."""

    cells: int
    volume_mm3: float
    label_volume_mm3: float
    volume_error: float


class InterfaceFigures(TypedDict):
    """Distances in mm of an interface's faces from the smooth surface; vertex_p95_mm : of their corners."""

    faces: int
    mean_mm: float
    rms_mm: float
    p95_mm: float
    max_mm: float
    vertex_p95_mm: float


class MeshQuality(TypedDict, total=False):
    """Figures of a mesh, keys in the order of the file; a file made by hand may hold some of them only.

    regions : by number. quantiles : by percentile, of each cell's smallest angle and of its radius ratio. edge_mm : the edge aimed at
    on the organ. surfaces : by name. attempts : meshes made until this one. seconds : wall time. recipe_sha256 : `mesh_file.recipe_hash`.
    """

    cells: int
    points: int
    regions: dict[str, RegionFigures]
    min_dihedral_deg: float
    max_dihedral_deg: float
    slivers: int
    dihedral_deg_quantiles: dict[str, float]
    radius_ratio_quantiles: dict[str, float]
    edge_mm: float
    surfaces: dict[str, InterfaceFigures]
    attempts: int
    seconds: float
    recipe_sha256: str


def dihedral_angles(points: FloatArray, cells: IntArray) -> FloatArray:
    """The six angles (m, 6) in degrees between the faces of each cell."""
    normal = normals(points[cells][:, FACES_OF_CELL])
    first, second = np.triu_indices(4, 1)
    cosine = -np.einsum("mpk,mpk->mp", normal[:, first], normal[:, second])
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def radius_ratio(points: FloatArray, cells: IntArray) -> FloatArray:
    """Three times inscribed over circumscribed radius (m,): 1 for a regular cell, 0 for a flat one."""
    a, b, c, d = (points[cells[:, i]] for i in range(4))
    u, v, w = b - a, c - a, d - a
    six_volume = np.abs(np.einsum("ij,ij->i", np.cross(u, v), w))
    area = sum(0.5 * np.linalg.norm(np.cross(p, q), axis=1) for p, q in ((u, v), (v, w), (w, u), (c - b, d - b)))
    squares = [np.einsum("ij,ij->i", p, p)[:, None] for p in (u, v, w)]
    top = squares[0] * np.cross(v, w) + squares[1] * np.cross(w, u) + squares[2] * np.cross(u, v)
    twelve_volume_radius = np.maximum(np.linalg.norm(top, axis=1), 1e-30)
    return np.asarray(3.0 * six_volume**2 / (area * twelve_volume_radius))


def shape(points: FloatArray, cells: IntArray) -> FloatArray:
    """One figure of shape (m,) in degrees: how far a cell's angles stay from 0 and 180, and its radius ratio times 120.

    A regular cell has 70. A cell with four points near a circle can have fair angles and a radius ratio near zero.
    """
    angles = dihedral_angles(points, cells)
    ratio = radius_ratio(points, cells)
    return np.minimum(np.minimum(angles.min(axis=1), 180.0 - angles.max(axis=1)), 120.0 * ratio)


def describe(mesh: TetMesh, labels: Volume) -> MeshQuality:
    """Counts, angles, radius ratios, and the volume of each region beside that of its voxels."""
    every_angle = dihedral_angles(mesh.points, mesh.cells)
    angles = every_angle.min(axis=1)
    ratios = radius_ratio(mesh.points, mesh.cells)
    voxel = float(np.abs(np.linalg.det(labels.affine[:3, :3])))
    regions: dict[str, RegionFigures] = {}
    for region in np.unique(mesh.regions).tolist():
        volume = float(mesh.volumes[mesh.regions == region].sum())
        voxels = float((labels.array == region).sum() * voxel)
        regions[str(region)] = {
            "cells": int((mesh.regions == region).sum()),
            "volume_mm3": volume,
            "label_volume_mm3": voxels,
            "volume_error": volume / voxels - 1.0,
        }
    return {
        "cells": len(mesh.cells),
        "points": len(mesh.points),
        "regions": regions,
        "min_dihedral_deg": float(angles.min()),
        "max_dihedral_deg": float(every_angle.max()),
        "slivers": int((angles < SLIVER_DEG).sum()),
        "dihedral_deg_quantiles": _quantiles(angles),
        "radius_ratio_quantiles": _quantiles(ratios),
    }


def _quantiles(values: FloatArray) -> dict[str, float]:
    return {f"{q:g}": float(np.percentile(values, q)) for q in (0, 1, 5, 50, 95, 100)}
