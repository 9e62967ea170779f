"""Strain stiffening of the surrounding tissue."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.materials import Material
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.forward.material_changes import per_cell
from palpate.core.forward.parameters import TISSUE
from palpate.core.laws.stiffening import STIFFENING
from palpate.core.mesh import TetMesh

# The effect of stiffening on the organ saturates. The exponent therefore grows exponentially with phi, in which the
# data are nearly linear: slopes at phi = 0 and at the best fit differ by a factor below 1.6, by 2 to 5 in the exponent
# itself.
_UNIT_EXPONENT = 2.0


def exponent(phi: float) -> float:
    """Exponent of the tissue's law at phi."""
    return float(_UNIT_EXPONENT * np.expm1(max(phi, 0.0)))


def _variants(around: Surroundings) -> list[Variant]:
    return [Variant(_stiffen)]


def _stiffen(composition: Composition, phi: FloatArray) -> Composition:
    def change(mesh: TetMesh, materials: Mapping[int, Material]) -> dict[int, Material]:
        values, _ = per_cell(mesh, materials, TISSUE)
        values = np.column_stack([values[:, 0], values[:, 1], exponent(float(phi[0])) * values[:, 0]])
        return {**materials, TISSUE: Material(STIFFENING, values)}

    return composition.with_law(change)


EFFECT = Effect(
    "tissue_stiffening",
    "the surrounding tissue stiffens as it is strained",
    (Parameter("exponent", "1", 1.5, 0.0, 3.4, exponent),),
    _variants,
    "a second deformed scan with about half the bladder or rectum filling: only then does stiffening show as a curve",
    on_bench=False,
)
