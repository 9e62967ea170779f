"""The organ gives up volume under pressure."""

from __future__ import annotations

from collections.abc import Mapping

from palpate.core.fem.materials import Material
from palpate.core.gap.composition import Composition
from palpate.core.gap.effects.base import Effect, FloatArray, Parameter, Surroundings, Variant
from palpate.core.gap.material_changes import per_cell
from palpate.core.mesh import TetMesh


def _variants(around: Surroundings) -> list[Variant]:
    return [Variant(_soften)]


def _soften(composition: Composition, phi: FloatArray) -> Composition:
    """phi is what the ratio G / K grows by: the volume given up is proportional to it."""
    organ = composition.problem.regions

    def change(mesh: TetMesh, materials: Mapping[int, Material]) -> dict[int, Material]:
        out = dict(materials)
        for region in organ:
            values, law = per_cell(mesh, materials, region)
            G, K = law.shear_modulus_of(values), law.kappa_of(values)
            values = values.copy()
            values[:, law.parameters.index("v1")] *= 1.0 / (1.0 + float(phi[0]) * K / G)
            out[region] = Material(law, values)
        return out

    return composition.with_law(change)


def poisson_ratio(phi: float, plain: float = 0.495) -> float:
    """Small-strain Poisson ratio for what G / K has grown by."""
    ratio = 3.0 * (1.0 - 2.0 * plain) / (2.0 * (1.0 + plain)) + phi
    return float((3.0 - 2.0 * ratio) / (6.0 + 2.0 * ratio))


EFFECT = Effect(
    "compressible_organ",
    "the organ gives up volume under pressure",
    (Parameter("poisson_ratio", "1", 0.25, 0.0, 1.2, poisson_ratio),),
    _variants,
    "a second deformed scan with another filling: a compressible organ loses volume in proportion to the pressure",
)
