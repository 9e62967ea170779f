"""Anisotropy of the organ: stiffer along one direction."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.materials import Material
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.forward.material_changes import per_cell
from palpate.core.laws.fibre import with_fibres
from palpate.core.mesh import TetMesh


def _variants(around: Surroundings) -> list[Variant]:
    return [_variant(a) for a in _directions()]


def _directions() -> FloatArray:
    """Unit directions (13, 3) to faces, edges and corners of a cube, one of each opposite pair."""
    grid = np.stack(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    half = grid[len(grid) // 2 + 1 :]
    return half / np.linalg.norm(half, axis=1)[:, None]


def _variant(a: FloatArray) -> Variant:
    across = np.linalg.svd(a[None])[2][1:]

    def change(composition: Composition, phi: FloatArray) -> Composition:
        organ = composition.problem.regions
        along = a + np.deg2rad(phi[1:]) @ across
        along /= np.linalg.norm(along)

        def stiffer(mesh: TetMesh, materials: Mapping[int, Material]) -> dict[int, Material]:
            out = dict(materials)
            for region in organ:
                values, law = per_cell(mesh, materials, region)
                extra = 3.0 * float(phi[0]) * law.shear_modulus_of(values)
                out[region] = Material(with_fibres(law, along), np.column_stack([values, extra]))
            return out

        return composition.with_law(stiffer)

    return Variant(change, "along ({:.2f}, {:.2f}, {:.2f})".format(*a.tolist()))


EFFECT = Effect(
    "fibre_anisotropy",
    "the organ is stiffer along one direction than across it",
    (
        Parameter("stiffness_share", "1", 1.5, -0.3, 10.0),
        Parameter("tilt_1", "deg", 12.0, -35.0, 35.0, secondary=True),
        Parameter("tilt_2", "deg", 12.0, -35.0, 35.0, secondary=True),
    ),
    _variants,
    "a second deformed scan that squeezes the organ along another direction",
)
