"""Facts of a case (case.json): typed and checked; unknown keys are refused."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Annotated, Literal

from msgspec import Meta

from palpate.core.errors import InputError
from palpate.core.files.json_types import refusal, typed
from palpate.core.files.nearest_name import nearest

Vector = tuple[float, float, float]
# Upper bound for the length of a stated gravity vector, m/s2: twice the Earth's.
_GRAVITY_MAX = 20.0
_Modulus = Annotated[float, Meta(ge=1e-3, le=1e6)]
_Bounds = Annotated[tuple[_Modulus, _Modulus], Meta(description="two rising numbers from 0.001 to 1e+06")]
_Component = Annotated[float, Meta(ge=-_GRAVITY_MAX, le=_GRAVITY_MAX)]
Gravity = Annotated[
    tuple[_Component, _Component, _Component], Meta(description="three numbers in m/s^2 of length at most 20")
]
# Keys of case.json beyond the facts: a body on a bench and further deformed states (`stated_files`), what a simulated
# case says of itself, and remarks of a person, which nothing reads.
_OF_A_BODY = ("supports", "model_gravity", "cells")
OTHER_KEYS = ("body", "states", *_OF_A_BODY, "density_kg_m3", "simulated", "simulated_note", "notes")
_Name = Annotated[str, Meta(pattern=r"^[^\n]*\S[^\n]*$(?!\n)", description="a name of one line")]


@dataclass(frozen=True)
class CaseFacts:
    """Content of case.json (docs/case.md).

    Moduli are small-strain shear moduli in kPa; noise is in mm; gravity is in m/s^2 in patient coordinates (LPS), None
    where unknown. ``other`` holds the further keys (`OTHER_KEYS`), so that saving loses nothing.
    """

    name: _Name
    tissue_shear_modulus_kpa: _Modulus = 20.0
    tissue_poisson_ratio: Annotated[float, Meta(ge=0.0, le=0.4999)] = 0.49
    organ_shear_modulus_bounds_kpa: _Bounds = (5.0, 500.0)
    boundary_noise_sd_mm: Annotated[float, Meta(ge=1e-3, le=20.0)] | None = None
    gravity_rest: Gravity | None = None
    gravity_deformed: Gravity | None = None
    outer_surface: Literal["fixed", "free"] = "fixed"
    other: Mapping[str, object] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, data: object, source: str) -> CaseFacts:
        """Facts from a parsed case.json; absent keys take the defaults of the fields.

        ``source`` is the file's path. Raises InputError naming the property, its value and the allowed values, or a key
        that is unknown.
        """
        if not isinstance(data, Mapping):
            raise InputError(f"{source} holds {type(data).__name__}; write one JSON object as docs/case.md shows")
        own = {f.name for f in fields(cls)} - {"other"}
        other = {key: value for key, value in data.items() if key not in own}
        known = sorted(own.union(OTHER_KEYS))
        for key in other:
            if key not in OTHER_KEYS:
                raise InputError(f"{source}: {key} is unknown; {nearest(key, known)} (remarks go under 'notes')")
            if key in _OF_A_BODY and "body" not in other:
                raise InputError(
                    f"{source}: {key} is of a body on a bench, whose surface 'body' names; add that, or take {key} out"
                )
        facts = typed({key: data[key] for key in data if key in own} | {"other": other}, cls, source)
        low, high = facts.organ_shear_modulus_bounds_kpa
        refused = [] if low < high else ["organ_shear_modulus_bounds_kpa"]
        stated = {"gravity_rest": facts.gravity_rest, "gravity_deformed": facts.gravity_deformed}
        refused += [key for key, g in stated.items() if g is not None and is_too_long(g)]
        for key in refused:
            raise refusal(cls, key, data[key], source)
        return facts

    def to_dict(self) -> dict[str, object]:
        """JSON object of case.json, the keys of ``other`` last."""
        own: dict[str, object] = {
            key: list(value) if isinstance(value := getattr(self, key), tuple) else value
            for key in self.__dataclass_fields__
            if key != "other"
        }
        return own | dict(self.other)


def is_too_long(gravity: Vector) -> bool:
    """Whether a gravity vector, m/s2, is longer than any that a body on Earth meets."""
    return math.hypot(*gravity) > _GRAVITY_MAX
