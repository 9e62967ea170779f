"""Swelling or shrinking of the organ between the scans."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.fem.materials import Material
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant
from palpate.core.laws.grown import grown
from palpate.core.mesh import TetMesh


def _variants(around: Surroundings) -> list[Variant]:
    return [Variant(_grow)]


def _grow(composition: Composition, phi: FloatArray) -> Composition:
    organ = composition.problem.regions

    def change(mesh: TetMesh, materials: Mapping[int, Material]) -> dict[int, Material]:
        out = dict(materials)
        for region in organ:
            out[region] = Material(grown(materials[region].law, float(np.exp(phi[0]))), materials[region].values)
        return out

    return composition.with_kinematics(change)


EFFECT = Effect(
    "volume_change",
    "the organ swelled or shrank between the scans",
    (Parameter("log_volume_ratio", "1", 0.10, -0.5, 0.5, own=True),),
    _variants,
    "the organ's volume measured apart from these contours (ultrasound or MR on both days), or points inside it",
)
