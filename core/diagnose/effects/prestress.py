"""Prestress of the scan at rest: bladder or rectum are filled, and the stress-free shape is another."""

from __future__ import annotations

from palpate.core.arrays import FloatArray
from palpate.core.forward.composition import Composition
from palpate.core.forward.effect import Effect, Parameter, Surroundings, Variant

_WALLS = ("bladder", "rectum")


def _variants(around: Surroundings) -> list[Variant]:
    fields = {name: f for name, f in around.pressure_fields().items() if name in _WALLS}
    if len(fields) < len(_WALLS):
        return []

    def change(composition: Composition, phi: FloatArray) -> Composition:
        shift = -sum(phi[k] * fields[name] for k, name in enumerate(_WALLS))
        return composition.with_geometry(shift)

    return [Variant(change)]


EFFECT = Effect(
    "prestress",
    "the scan at rest is already loaded by what fills bladder and rectum",
    (Parameter("bladder_filling", "mm", 3.0, -9.0, 9.0), Parameter("rectum_filling", "mm", 3.0, -9.0, 9.0)),
    _variants,
    "a scan with bladder and rectum as empty as they can be, taken as the state at rest",
    on_bench=False,
)
