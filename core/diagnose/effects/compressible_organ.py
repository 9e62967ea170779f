"""Compressibility of the organ: it loses volume under pressure."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.materials import Material
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.forward.material_changes import per_cell
from palpate.core.mesh import TetMesh

# The lost volume saturates as G / K grows, the sooner the softer the organ. G / K therefore grows exponentially with
# phi, in which the data are more nearly linear.
_UNIT_RATIO = 0.05
# phi at which Poisson's ratio is 0, the least of any tissue.
_AT_ZERO = 3.42


def _variants(around: Surroundings) -> list[Variant]:
    return [Variant(_soften)]


def _soften(composition: Composition, phi: FloatArray) -> Composition:
    organ = composition.problem.regions

    def change(mesh: TetMesh, materials: Mapping[int, Material]) -> dict[int, Material]:
        out = dict(materials)
        for region in organ:
            values, law = per_cell(mesh, materials, region)
            G, K = law.shear_modulus_of(values), law.kappa_of(values)
            values = values.copy()
            unit = np.eye(len(law.parameters))
            of_volume = (law.kappa_of(unit) != 0.0) & (law.shear_modulus_of(unit) == 0.0)
            values[:, of_volume] *= (1.0 / (1.0 + given_way(float(phi[0])) * K / G))[:, None]
            out[region] = Material(law, values)
        return out

    return composition.with_law(change)


def given_way(phi: float) -> float:
    """Increase of the ratio G / K at phi."""
    return float(_UNIT_RATIO * np.expm1(max(phi, 0.0)))


def poisson_ratio(phi: float, plain: float = 0.495) -> float:
    """Poisson's ratio at small strain for phi; plain : at phi = 0."""
    ratio = 3.0 * (1.0 - 2.0 * plain) / (2.0 * (1.0 + plain)) + given_way(phi)
    return float((3.0 - 2.0 * ratio) / (6.0 + 2.0 * ratio))


EFFECT = Effect(
    "compressible_organ",
    "the organ gives up volume under pressure",
    (Parameter("poisson_ratio", "1", 1.5, 0.0, _AT_ZERO, poisson_ratio),),
    _variants,
    "a second deformed scan with another filling: a compressible organ loses volume in proportion to the pressure",
)
