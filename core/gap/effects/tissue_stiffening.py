"""The surrounding tissue stiffens with strain."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.fem.materials import Material
from palpate.core.gap.composition import Composition
from palpate.core.gap.effects.base import Effect, FloatArray, Parameter, Surroundings, Variant
from palpate.core.gap.material_changes import per_cell
from palpate.core.identify.parameters import TISSUE
from palpate.core.laws.stiffening import STIFFENING
from palpate.core.mesh import TetMesh


def _variants(around: Surroundings) -> list[Variant]:
    return [Variant(_stiffen)]


def _stiffen(composition: Composition, phi: FloatArray) -> Composition:
    def change(mesh: TetMesh, materials: Mapping[int, Material]) -> dict[int, Material]:
        values, _ = per_cell(mesh, materials, TISSUE)
        values = np.column_stack([values[:, 0], values[:, 1], float(phi[0]) * values[:, 0]])
        return {**materials, TISSUE: Material(STIFFENING, values)}

    return composition.with_law(change)


EFFECT = Effect(
    "tissue_stiffening",
    "the surrounding tissue stiffens as it is strained",
    (Parameter("exponent", "1", 6.0, 0.0, 60.0),),
    _variants,
    "a second deformed scan with about half the bladder or rectum filling: only then does stiffening show as a curve",
)
