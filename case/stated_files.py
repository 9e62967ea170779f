"""Files that only some cases have: those that case.json names, noise.json and surface_errors.npz.

case.json names the files of further deformed states and of a body on a bench.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import msgspec
from msgspec import Meta

from palpate.case.case_folder import CaseFolder
from palpate.case.measured_noise import FILE as NOISE_FILE
from palpate.core.errors import InputError
from palpate.core.files.json_types import typed

# Errors of the surfaces that the segmentation found, by place (`surface_errors`).
ERRORS_FILE = "surface_errors.npz"
# Name of a file directly in the case folder, without a folder before it.
_FileName = Annotated[
    str, Meta(pattern=r"^(?!\.{1,2}$)[^/\\\x00-\x1f]+$(?!\n)", description="the name of a file in the case folder")
]
# Bounds that only exclude infinity and NaN, for values in mm, m/s2 and N.
_Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
_Vector = tuple[_Number, _Number, _Number]
_AS_SHOWN = "; write it as docs/case.md shows"


class FurtherState(msgspec.Struct, frozen=True, omit_defaults=True):
    """Entry of `states` in case.json: one deformed state beyond the first.

    labels, landmarks : names of files in the case folder; landmarks is None where there are none. name : shown to
    people. source_sha256 : SHA-256 of the files that `add_state` read; empty for an entry written by hand.
    """

    labels: _FileName
    name: str = ""
    source_sha256: tuple[str, ...] = ()
    landmarks: _FileName | None = None

    @property
    def files(self) -> tuple[str, ...]:
        """Names of the state's files in the case folder."""
        return (self.labels,) if self.landmarks is None else (self.labels, self.landmarks)


def further_states(case: CaseFolder) -> tuple[FurtherState, ...]:
    """Further deformed states with their files checked; empty for a case of one pair.

    Raises InputError naming what is wrong with an entry, or the file that is missing.
    """
    return tuple(checked_state(case, state) for state in stated_states(case))


def state_entries(case: CaseFolder) -> list[object]:
    """Unchecked entries of `states` in case.json. Raises InputError when `states` is no list."""
    entries = case.facts.other.get("states") or []
    if not isinstance(entries, list):
        raise InputError(f"{case.file('case.json')}: states is no list; write states as docs/case.md shows")
    return entries


def stated_states(case: CaseFolder) -> list[FurtherState]:
    """Further deformed states as case.json states them; their files are not checked.

    States of a body on a bench have no labels and are left out. Raises InputError naming what is wrong with an entry.
    """
    source = str(case.file("case.json"))
    return [
        typed(entry, FurtherState, f"{source}: states[{k}]", "; write states as docs/case.md shows")
        for k, entry in enumerate(state_entries(case))
        if isinstance(entry, Mapping) and "labels" in entry
    ]


def checked_state(case: CaseFolder, state: FurtherState) -> FurtherState:
    """The state, with its label file's name where it had no name. Raises InputError when one of its files is
    missing.
    """
    for name in state.files:
        if not case.file(name).is_file():
            raise InputError(f"{case.file(name)} is not there, but case.json names it as a deformed state")
    return state if state.name else msgspec.structs.replace(state, name=state.labels)


def further_files(case: CaseFolder) -> list[str]:
    """Names of the files of further deformed states, then noise.json and surface_errors.npz where the case has them.

    Raises InputError naming what is wrong with an entry of `states`.
    """
    noise = [name for name in (NOISE_FILE, ERRORS_FILE) if case.has(name)]
    return [*(name for state in further_states(case) for name in state.files), *noise]


class Load(msgspec.Struct, frozen=True):
    """Point load. at : position on the body, mm. force_n : force, N."""

    at: _Vector
    force_n: _Vector
    name: str = ""


class MarkerState(msgspec.Struct, frozen=True):
    """One state of a body on a bench.

    points : name of its marker file, columns as in landmarks.csv. gravity : m/s2. points_sd_mm : standard deviation of
    a marker, mm per axis; None for the case's contour noise.
    """

    name: str
    points: str
    gravity: _Vector = (0.0, 0.0, 0.0)
    loads: tuple[Load, ...] = ()
    points_sd_mm: Annotated[float, Meta(gt=0.0, le=1e3)] | None = None


class Support(msgspec.Struct, frozen=True):
    """Plane that holds the body: boundary faces are fixed whose corners all lie within tolerance_mm of it. Point in
    mm.
    """

    plane_point: _Vector
    plane_normal: _Vector
    tolerance_mm: Annotated[float, Meta(ge=0.0, le=1e6)] = 0.5
    name: str = ""


class BenchBody(msgspec.Struct, frozen=True):
    """Keys of case.json for a body on a bench, beyond `CaseFacts`. body : name of its surface file (STL, OBJ, PLY)."""

    body: str
    states: Annotated[tuple[MarkerState, ...], Meta(min_length=1, description="a list of states, at least one")]
    supports: tuple[Support, ...] | None = ()
    density_kg_m3: Annotated[float, Meta(ge=0.0, lt=1e6, description="a density in kg/m3 from 0 to 1e+06")] = 1000.0
    model_gravity: bool = True


def is_body(case: CaseFolder) -> bool:
    """Whether the case is a body on a bench."""
    return "body" in case.facts.other


def bench_body(case: CaseFolder) -> BenchBody:
    """Description of the body in case.json. Raises InputError naming the property that is wrong."""
    source = str(case.file("case.json"))
    body = typed(case.facts.other, BenchBody, source, _AS_SHOWN)
    if not all(name.isprintable() for name in (body.body, *(state.points for state in body.states))):
        raise InputError(f"{source}: a file's name holds a line break; correct it")
    return body


def body_inputs(case: CaseFolder) -> tuple[str, ...]:
    """Names of the input files of a body on a bench. Raises InputError naming the property of case.json that is
    wrong.
    """
    body = bench_body(case)
    return "case.json", body.body, *(state.points for state in body.states)
