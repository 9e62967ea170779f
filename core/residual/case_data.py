"""Data of a case that a diagnosis reads, and their file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import InputError
from palpate.core.forward.effect import Vector
from palpate.core.problem import IdentificationProblem, StateData, SurfacePair
from palpate.core.residual.remeshing import Remeshed, all_from
from palpate.core.surfaces.surface import Surface

_KEYS = ("points", "faces", "region")


@dataclass(frozen=True, eq=False)
class CaseData:
    """bones : their surfaces at rest and deformed. gravity : m/s2 as stated, None when unknown. remeshed : other
    meshes.

    more : of further deformed states, on the same mesh and with the same organ at rest, each its problem and its bones.
    """

    problem: IdentificationProblem
    bones: SurfacePair | None = None
    gravity: tuple[Vector | None, Vector | None] = (None, None)
    remeshed: tuple[Remeshed, ...] = ()
    more: tuple[StateData, ...] = ()

    @property
    def pairs(self) -> list[StateData]:
        """Problem and bones of every deformed state."""
        return [(self.problem, self.bones), *self.more]


def arrays(data: CaseData) -> dict[str, NDArray[np.generic]]:
    """For numpy.savez; `load` is the inverse."""
    out: dict[str, NDArray[np.generic]] = {}
    for k, (problem, bones) in enumerate(data.pairs):
        state_arrays = arrays_of_state(problem, bones)
        out |= {f"{_prefix(k)}{key}": values for key, values in state_arrays.items()}
    for k, other in enumerate(data.remeshed):
        out |= other.arrays(f"remeshed/{k}")
    out["gravity"] = np.frombuffer(json.dumps(data.gravity).encode(), dtype=np.uint8)
    return out


def load(path: Path) -> CaseData:
    """Case data from their file. Raises InputError when it is missing or holds something else."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            all_arrays = {key: archive[key] for key in archive.files}
        gravity = json.loads(bytes(np.asarray(all_arrays["gravity"], dtype=np.uint8)).decode())
        pairs, remeshed = _pairs(all_arrays), all_from(all_arrays, "remeshed")
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not readable as a case's data ({error}); run diagnose again") from error
    return CaseData(*pairs[0], (_vector(gravity[0]), _vector(gravity[1])), remeshed, tuple(pairs[1:]))


def arrays_of_state(problem: IdentificationProblem, bones: SurfacePair | None) -> dict[str, NDArray[np.generic]]:
    """One deformed state for numpy.savez; `load_state` is the inverse."""
    return problem.arrays() | _of_bones(bones)


def load_state(path: Path) -> StateData:
    """Problem and bones of one deformed state. Raises InputError when the file is missing or holds something else."""
    problem = IdentificationProblem.load(path)
    with np.load(path, allow_pickle=False) as archive:
        return problem, _bones({key: archive[key] for key in archive.files if key.startswith("bones/")})


def _prefix(state: int) -> str:
    return f"state_{state + 1}/" if state else ""


def _pairs(all_arrays: Mapping[str, NDArray[np.generic]]) -> list[StateData]:
    out: list[StateData] = []
    while not out or f"{_prefix(len(out))}scalars" in all_arrays:
        before = _prefix(len(out))
        here = {key.removeprefix(before): values for key, values in all_arrays.items() if key.startswith(before)}
        out.append((IdentificationProblem.from_arrays(here), _bones(here)))
    return out


def _of_bones(bones: SurfacePair | None) -> dict[str, NDArray[np.generic]]:
    if bones is None:
        return {}
    states = (("rest", bones.rest), ("deformed", bones.deformed))
    return {f"bones/{state}/{key}": getattr(surface, key) for state, surface in states for key in _KEYS}


def _vector(value: Any) -> tuple[float, float, float] | None:
    return None if value is None else (float(value[0]), float(value[1]), float(value[2]))


def _bones(state_arrays: Mapping[str, NDArray[np.generic]]) -> SurfacePair | None:
    if "bones/rest/points" not in state_arrays:
        return None
    rest, deformed = (
        Surface(*(np.asarray(state_arrays[f"bones/{state}/{key}"]) for key in _KEYS)) for state in ("rest", "deformed")
    )
    return SurfacePair(rest, deformed)
