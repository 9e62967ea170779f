"""What is dear to find of a problem's geometry, as arrays for a file: distance fields, how far walls slip, and how matched
motion is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from palpate.core.arrays import FloatArray
from palpate.core.forward.scene_parts import DistanceFields
from palpate.core.observe.wall_slip import WallSlip
from palpate.core.surfaces.distance_field import SignedDistanceField

_STATES = ("rest", "deformed")


@dataclass(frozen=True, eq=False)
class KnownGeometry:
    """target : signed distance of the organ's deformed surface. fields : of every driving wall, at rest and deformed.

    slips : of every driving wall, None where it is unknown. reader (m, d) : of matched motion, see `MotionObservation`.
    """

    target: SignedDistanceField
    fields: Mapping[str, DistanceFields]
    slips: Mapping[str, WallSlip | None]
    reader: FloatArray

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """For numpy.savez; `from_arrays` is the inverse."""
        out: dict[str, NDArray[np.generic]] = _under("target", self.target.arrays()) | {"motion_reader": self.reader}
        for name, pair in self.fields.items():
            for state, field in zip(_STATES, pair, strict=True):
                out |= _under(f"walls/{name}/{state}", field.arrays())
        for name, slip in self.slips.items():
            if slip is not None:
                out |= {f"slips/{name}/points": slip.points, f"slips/{name}/half": slip.half}
        return out

    @classmethod
    def from_arrays(cls, data: Mapping[str, NDArray[np.generic]]) -> KnownGeometry:
        """Walls in the order of `data`. Raises KeyError where arrays are missing."""
        names = list(dict.fromkeys(key.split("/")[1] for key in data if key.startswith("walls/")))
        fields = {name: (_field(data, f"walls/{name}/rest"), _field(data, f"walls/{name}/deformed")) for name in names}
        slips = {name: _slip(data, f"slips/{name}") for name in names}
        return cls(_field(data, "target"), fields, slips, np.asarray(data["motion_reader"], dtype=np.float64))


def _under(place: str, arrays: Mapping[str, NDArray[np.generic]]) -> dict[str, NDArray[np.generic]]:
    return {f"{place}/{key}": values for key, values in arrays.items()}


def _field(data: Mapping[str, NDArray[np.generic]], place: str) -> SignedDistanceField:
    return SignedDistanceField.from_arrays(
        {key: data[f"{place}/{key}"] for key in ("coefficients", "origin", "spacing")}
    )


def _slip(data: Mapping[str, NDArray[np.generic]], place: str) -> WallSlip | None:
    if f"{place}/points" not in data:
        return None
    points, half = (np.asarray(data[f"{place}/{key}"], dtype=np.float64) for key in ("points", "half"))
    return WallSlip(points, half)
