"""Building blocks of effects that change materials."""

from __future__ import annotations

from collections.abc import Mapping

from palpate.core.arrays import FloatArray
from palpate.core.fem.materials import Material
from palpate.core.forward.composition import MaterialChange
from palpate.core.laws.base import Law
from palpate.core.mesh import TetMesh


def per_cell(mesh: TetMesh, materials: Mapping[int, Material], region: int) -> tuple[FloatArray, Law]:
    """Parameter values (cells of the region, k) of a region, and its law."""
    material = materials[region]
    return material.per_cell(int((mesh.regions == region).sum())), material.law


def scaled(regions: tuple[int, ...], factor: FloatArray) -> MaterialChange:
    """Change that multiplies all moduli of the given regions' cells by factor (cells of the mesh,)."""

    def change(mesh: TetMesh, materials: Mapping[int, Material]) -> dict[int, Material]:
        out = dict(materials)
        for region in regions:
            values, law = per_cell(mesh, materials, region)
            out[region] = Material(law, values * factor[mesh.regions == region, None])
        return out

    return change
