"""Files that only some cases have: those of further deformed states and of a body on a bench, named in case.json, and noise.json."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import msgspec
from msgspec import Meta

from palpate.case.case_folder import CaseFolder
from palpate.case.measured_noise import FILE as NOISE_FILE
from palpate.core.errors import InputError
from palpate.core.files.json_types import typed

# A file that lies in the case folder itself: no folder before it.
_FileName = Annotated[
    str, Meta(pattern=r"^(?!\.{1,2}$)[^/\\\x00-\x1f]+$(?!\n)", description="the name of a file in the case folder")
]
# Bounds that only keep infinity and NaN out: mm, m/s2, N.
_Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
_Vector = tuple[_Number, _Number, _Number]
_AS_SHOWN = "; write it as docs/case.md shows"


class FurtherState(msgspec.Struct, frozen=True, omit_defaults=True):
    """name : for people. labels, landmarks : files of the case; landmarks None where there are none.

    source_sha256 : of the files that it was made from, where `add_state` did.
    """

    labels: _FileName
    name: str = ""
    source_sha256: tuple[str, ...] = ()
    landmarks: _FileName | None = None

    @property
    def files(self) -> tuple[str, ...]:
        """Of the case, that this state consists of."""
        return (self.labels,) if self.landmarks is None else (self.labels, self.landmarks)


def further_states(case: CaseFolder) -> tuple[FurtherState, ...]:
    """Those of case.json that have labels; none for a case of one pair. Raises InputError naming what is wrong with an entry."""
    return tuple(checked_state(case, state) for state in stated_states(case))


def state_entries(case: CaseFolder) -> list[object]:
    """What stands under `states` in case.json. Raises InputError where that is no list."""
    found = case.facts.other.get("states") or []
    if not isinstance(found, list):
        raise InputError(f"{case.file('case.json')}: states is no list; write states as docs/case.md shows")
    return found


def stated_states(case: CaseFolder) -> list[FurtherState]:
    """As case.json says; a state of a body on a bench has no labels and is left out."""
    source = str(case.file("case.json"))
    return [
        typed(entry, FurtherState, f"{source}: states[{k}]", "; write states as docs/case.md shows")
        for k, entry in enumerate(state_entries(case))
        if isinstance(entry, Mapping) and "labels" in entry
    ]


def checked_state(case: CaseFolder, state: FurtherState) -> FurtherState:
    """The state, named. Raises InputError where a file is not there."""
    for name in state.files:
        if not case.file(name).is_file():
            raise InputError(f"{case.file(name)} is not there, but case.json names it as a deformed state")
    return state if state.name else msgspec.structs.replace(state, name=state.labels)


def further_files(case: CaseFolder) -> list[str]:
    """Files of further deformed states, and noise.json where the case has had the repeatability of its contours measured."""
    noise = [NOISE_FILE] if case.has(NOISE_FILE) else []
    return [*(name for state in further_states(case) for name in state.files), *noise]


class Load(msgspec.Struct, frozen=True):
    """A force in N that acts at a point of the body, mm."""

    at: _Vector
    force_n: _Vector
    name: str = ""


class MarkerState(msgspec.Struct, frozen=True):
    """One state of the body. points : file of its markers, columns as landmarks.csv. gravity : m/s2. points_sd_mm : per axis."""

    name: str
    points: str
    gravity: _Vector = (0.0, 0.0, 0.0)
    loads: tuple[Load, ...] = ()
    points_sd_mm: Annotated[float, Meta(gt=0.0, le=1e3)] | None = None


class Support(msgspec.Struct, frozen=True):
    """Faces of the body whose corners all lie within tolerance_mm of a plane are held."""

    plane_point: _Vector
    plane_normal: _Vector
    tolerance_mm: Annotated[float, Meta(ge=0.0, le=1e6)] = 0.5
    name: str = ""


class BenchBody(msgspec.Struct, frozen=True):
    """What case.json says of a body on a bench beyond `CaseFacts`. body : file of its surface (STL, OBJ, PLY)."""

    body: str
    states: Annotated[tuple[MarkerState, ...], Meta(min_length=1, description="a list of states, at least one")]
    supports: tuple[Support, ...] | None = ()
    density_kg_m3: Annotated[float, Meta(ge=0.0, lt=1e6, description="a density in kg/m3 from 0 to 1e+06")] = 1000.0
    model_gravity: bool = True


def is_body(case: CaseFolder) -> bool:
    """Whether the case is a body on a bench."""
    return "body" in case.facts.other


def bench_body(case: CaseFolder) -> BenchBody:
    """What case.json says of the body. Raises InputError naming the property that is wrong."""
    source = str(case.file("case.json"))
    found = typed(case.facts.other, BenchBody, source, _AS_SHOWN)
    if not all(name.isprintable() for name in (found.body, *(state.points for state in found.states))):
        raise InputError(f"{source}: a file's name holds a line break; correct it")
    return found


def body_inputs(case: CaseFolder) -> tuple[str, ...]:
    """Names of the files that such a case consists of. Raises InputError when a state names no points."""
    found = bench_body(case)
    return "case.json", found.body, *(state.points for state in found.states)
