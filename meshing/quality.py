"""How good a tetrahedral mesh is, and how well it follows the labels."""

from __future__ import annotations

from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.mesh import TetMesh
from palpate.imaging.volume import Volume
from palpate.meshing.cell_shape import dihedral_angles, radius_ratio

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
