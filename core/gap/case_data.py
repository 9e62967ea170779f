"""What a diagnosis sees of a case, and its file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import InputError
from palpate.core.gap.effects.base import Vector
from palpate.core.gap.remeshed import Remeshed, all_from
from palpate.core.problem import IdentificationProblem, Surface, SurfacePair

_KEYS = ("points", "faces", "region")


@dataclass(frozen=True, eq=False)
class CaseData:
    """bones : their surfaces at rest and deformed. gravity : m/s2 as stated, None when unknown. remeshed : other meshes."""

    problem: IdentificationProblem
    bones: SurfacePair | None = None
    gravity: tuple[Vector | None, Vector | None] = (None, None)
    remeshed: tuple[Remeshed, ...] = ()


def arrays(data: CaseData) -> dict[str, NDArray[np.generic]]:
    """For numpy.savez; `load` is the inverse."""
    out = dict(data.problem.arrays())
    if data.bones is not None:
        for state, surface in (("rest", data.bones.rest), ("deformed", data.bones.deformed)):
            out |= {f"bones/{state}/{key}": getattr(surface, key) for key in _KEYS}
    for k, other in enumerate(data.remeshed):
        out |= other.arrays(f"remeshed/{k}")
    out["gravity"] = np.frombuffer(json.dumps(data.gravity).encode(), dtype=np.uint8)
    return out


def load(path: Path) -> CaseData:
    """Raises InputError when the file is missing or not such data."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            found = {key: archive[key] for key in archive.files}
        gravity = json.loads(bytes(np.asarray(found["gravity"], dtype=np.uint8)).decode())
        problem, remeshed = IdentificationProblem.from_arrays(found), all_from(found, "remeshed")
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not readable as a case's data ({error}); run diagnose again") from error
    return CaseData(problem, _bones(found), (_vector(gravity[0]), _vector(gravity[1])), remeshed)


def _vector(value: Any) -> tuple[float, float, float] | None:
    return None if value is None else (float(value[0]), float(value[1]), float(value[2]))


def _bones(found: Mapping[str, NDArray[np.generic]]) -> SurfacePair | None:
    if "bones/rest/points" not in found:
        return None
    rest, deformed = (
        Surface(*(np.asarray(found[f"bones/{state}/{key}"]) for key in _KEYS)) for state in ("rest", "deformed")
    )
    return SurfacePair(rest, deformed)
