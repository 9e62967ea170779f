"""The facts of a case (case.json): typed, checked, unknown keys kept."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from palpate.core.errors import InputError

Vector = tuple[float, float, float]
OUTER_SURFACES = ("fixed", "free")


@dataclass(frozen=True)
class CaseFacts:
    """What case.json says (docs/case.md).

    Moduli in kPa (small-strain shear moduli), noise in mm, gravity in m/s^2 in patient coordinates (LPS), None where
    unknown. ``other`` keeps the keys that this program does not type (body, supports, states, density_kg_m3,
    model_gravity and whatever else a person wrote), so that saving loses nothing.
    """

    name: str
    tissue_shear_modulus_kpa: float = 20.0
    tissue_poisson_ratio: float = 0.49
    organ_shear_modulus_bounds_kpa: tuple[float, float] = (5.0, 500.0)
    boundary_noise_sd_mm: float | None = None
    gravity_rest: Vector | None = None
    gravity_deformed: Vector | None = None
    outer_surface: str = "fixed"
    other: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], source: str) -> CaseFacts:
        """The facts of a parsed case.json; absent keys take the defaults above.

        ``source`` is the file's path. Raises InputError naming the property, its value and what is allowed.
        """
        if not isinstance(data, Mapping):
            raise InputError(f"{source} holds {type(data).__name__}; write one JSON object as docs/case.md shows")
        check = _Checker(data, source)
        return cls(
            name=check.text("name"),
            tissue_shear_modulus_kpa=check.number("tissue_shear_modulus_kpa", 20.0, 1e-3, 1e6),
            tissue_poisson_ratio=check.number("tissue_poisson_ratio", 0.49, 0.0, 0.4999),
            organ_shear_modulus_bounds_kpa=check.bounds("organ_shear_modulus_bounds_kpa", (5.0, 500.0)),
            boundary_noise_sd_mm=check.optional_number("boundary_noise_sd_mm", 1e-3, 20.0),
            gravity_rest=check.gravity("gravity_rest"),
            gravity_deformed=check.gravity("gravity_deformed"),
            outer_surface=check.choice("outer_surface", OUTER_SURFACES),
            other={key: value for key, value in data.items() if key not in cls.__dataclass_fields__ or key == "other"},
        )

    def to_dict(self) -> dict[str, Any]:
        """The JSON object of case.json, unknown keys last."""
        typed: dict[str, Any] = {
            key: list(value) if isinstance(value := getattr(self, key), tuple) else value
            for key in self.__dataclass_fields__
            if key != "other"
        }
        return typed | dict(self.other)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


class _Checker:
    """Reads one key at a time and says what is wrong with it in one line."""

    def __init__(self, data: Mapping[str, Any], source: str) -> None:
        self.data = data
        self.source = source

    def refuse(self, key: str, allowed: str) -> InputError:
        return InputError(f"{self.source}: {key} is {self.data.get(key)!r}; it must be {allowed}; correct it there")

    def text(self, key: str) -> str:
        value = self.data.get(key)
        if not isinstance(value, str) or not value.strip() or "\n" in value:
            raise self.refuse(key, "a name of one line")
        return value

    def number(self, key: str, default: float, low: float, high: float) -> float:
        value = self.data.get(key, default)
        if not _is_number(value) or not low <= value <= high:
            raise self.refuse(key, f"a number from {low:g} to {high:g}")
        return float(value)

    def optional_number(self, key: str, low: float, high: float) -> float | None:
        value = self.data.get(key)
        if value is None:
            return None
        if not _is_number(value) or not low <= value <= high:
            raise self.refuse(key, f"a number from {low:g} to {high:g}, or null when unknown")
        return float(value)

    def bounds(self, key: str, default: tuple[float, float]) -> tuple[float, float]:
        value = self.data.get(key, default)
        pair = isinstance(value, list | tuple) and len(value) == 2 and all(_is_number(v) for v in value)
        if not pair or not 1e-3 <= value[0] < value[1] <= 1e6:
            raise self.refuse(key, "two rising numbers from 0.001 to 1e+06")
        return float(value[0]), float(value[1])

    def gravity(self, key: str) -> Vector | None:
        value = self.data.get(key)
        if value is None:
            return None
        three = isinstance(value, list | tuple) and len(value) == 3 and all(_is_number(v) for v in value)
        if not three or math.hypot(*value) > 20.0:
            raise self.refuse(key, "three numbers in m/s^2 of length at most 20, or null when unknown")
        return float(value[0]), float(value[1]), float(value[2])

    def choice(self, key: str, allowed: tuple[str, ...]) -> str:
        value = self.data.get(key, allowed[0])
        if value not in allowed:
            raise self.refuse(key, " or ".join(repr(a) for a in allowed))
        return str(value)
