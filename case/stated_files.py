"""Files that only some cases have: those that case.json names, noise.json and surface_errors.npz.

case.json names the files of further deformed states and of a body on a bench.
"""

from __future__ import annotations

from typing import Annotated

import msgspec
from msgspec import Meta

from palpate.case.case_facts import Gravity, is_too_long
from palpate.case.case_folder import CaseFolder
from palpate.case.measured_noise import FILE as NOISE_FILE
from palpate.core.errors import InputError
from palpate.core.files.json_types import refusal, typed

# Errors of the surfaces that the segmentation found, by place (`surface_errors`).
ERRORS_FILE = "surface_errors.npz"
# Name of a file directly in the case folder, without a folder before it.
_FileName = Annotated[
    str, Meta(pattern=r"^(?!\.{1,2}$)[^/\\\x00-\x1f]+$(?!\n)", description="the name of a file in the case folder")
]
# Bounds that only exclude infinity and NaN, for values in mm, m/s2 and N.
_Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
_Vector = tuple[_Number, _Number, _Number]
_PerAxis = Annotated[
    tuple[_Number | None, _Number | None, _Number | None],
    Meta(description="3 numbers, along x, y and z, of which some may be null"),
]
# Errors, one for all axes or one for each. Their bounds are checked where they are read: msgspec 0.20 reads beyond its
# own memory where a union of a number and a tuple has any.
_Errors = Annotated[
    float | tuple[float | None, float | None, float | None],
    Meta(description="a number, or 3 numbers of which some may be null"),
]
# Solids and liquids, from the lightest foam up to metals. 0 is a body without weight.
_LIGHTEST = 10.0
Density = Annotated[float, Meta(ge=0.0, le=25e3, description="a density in kg/m3 from 10 to 25000 (water: 1000), or 0")]
_AS_SHOWN = "; write it as docs/case.md shows"


class FurtherState(msgspec.Struct, frozen=True, omit_defaults=True, forbid_unknown_fields=True):
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
    if is_body(case):
        return []
    return [
        typed(entry, FurtherState, f"{source}: states[{k}]", "; write states as docs/case.md shows")
        for k, entry in enumerate(state_entries(case))
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


def by_axis(errors: _Errors, where: str, least: float = 0.0) -> tuple[float | None, float | None, float | None]:
    """Errors along x, y and z; None along an axis that has none. where : path and property, for the error.

    Raises InputError for one that is not above `least` and below 1e6.
    """
    found = errors if isinstance(errors, tuple) else (errors, errors, errors)
    for value in found:
        if value is not None and not least < value < 1e6:
            raise InputError(f"{where} is {value:g}; it must be a number above {max(least, 0.0):g} and below 1e+06")
    return found


class Load(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Point load. at : position on the body, mm. force_n : force, N."""

    at: _Vector
    force_n: _Vector
    name: str = ""


class Patch(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Part of the body's surface: faces whose corners all lie within tolerance_mm of a plane, or whose centres lie within
    radius_mm of a centre, or both where both are given. Points in mm.
    """

    plane_point: _Vector | None = None
    plane_normal: _Vector | None = None
    tolerance_mm: Annotated[float, Meta(ge=0.0, le=1e6)] = 0.5
    centre: _Vector | None = None
    radius_mm: Annotated[float, Meta(gt=0.0, le=1e6)] | None = None
    name: str = ""


class Support(Patch, frozen=True, kw_only=True):
    """Patch that holds the body in every state. axes : those along which it holds; along the others the body slides."""

    axes: Annotated[str, Meta(pattern=r"^[xyz]{1,3}\Z", description="some of the letters x, y and z")] = "xyz"


class MovedPatch(Patch, frozen=True, kw_only=True):
    """Patch that is moved as a whole in one state.

    displacement_mm : prescribed; null along an axis where it is free. displacement_sd_mm : error of it, one for all axes
    or one for each. reaction_n : measured force that the patch exerts on the body, N; null along an axis where it was not
    measured. reaction_sd_n : its error, likewise.
    """

    displacement_mm: _PerAxis
    displacement_sd_mm: _Errors = 0.0
    reaction_n: _PerAxis | None = None
    reaction_sd_n: _Errors | None = None


class MarkerState(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One state of a body on a bench.

    points : name of its marker file, columns as in landmarks.csv. gravity : m/s2. points_sd_mm : standard deviation of
    a marker, mm, one for all axes or one for each, null along an axis that is not seen; None for the case's contour
    noise. points_common : share of the variance that the markers have in common. moved : patches that are moved in it.
    """

    name: str
    points: str
    gravity: Gravity = (0.0, 0.0, 0.0)
    loads: tuple[Load, ...] = ()
    points_sd_mm: _Errors | None = None
    points_common: Annotated[float, Meta(ge=0.0, lt=1.0, description="a share from 0 to 1")] | None = None
    moved: tuple[MovedPatch, ...] = ()


class BenchBody(msgspec.Struct, frozen=True):
    """Keys of case.json for a body on a bench, beyond `CaseFacts`.

    body : name of its surface file (STL, OBJ, PLY). cells : about how many tetrahedra its mesh has; None for the mesher's own number.
    """

    body: str
    states: Annotated[tuple[MarkerState, ...], Meta(min_length=1, description="a list of states, at least one")]
    supports: tuple[Support, ...] | None = ()
    density_kg_m3: Density = 1000.0
    model_gravity: bool = True
    cells: Annotated[int, Meta(ge=50, le=50_000, description="a number of tetrahedra from 50 to 50000")] | None = None


def is_body(case: CaseFolder) -> bool:
    """Whether the case is a body on a bench."""
    return "body" in case.facts.other


def bench_body(case: CaseFolder) -> BenchBody:
    """Description of the body in case.json. Raises InputError naming the property that is wrong."""
    source = str(case.file("case.json"))
    body = typed(case.facts.other, BenchBody, source, _AS_SHOWN)
    for k, state in enumerate(body.states):
        if is_too_long(state.gravity):
            raise refusal(MarkerState, "gravity", list(state.gravity), f"{source}: states[{k}]", _AS_SHOWN)
    check_density(body.density_kg_m3, source)
    if not all(name.isprintable() for name in (body.body, *(state.points for state in body.states))):
        raise InputError(f"{source}: a file's name holds a line break; correct it")
    return body


def body_inputs(case: CaseFolder) -> tuple[str, ...]:
    """Names of the input files of a body on a bench. Raises InputError naming the property of case.json that is
    wrong.
    """
    body = bench_body(case)
    return "case.json", body.body, *(state.points for state in body.states)


def check_density(density: float, source: str) -> None:
    """Raises InputError naming ``source`` where a density, kg/m3, is so low that it is in g/cm3 or t/mm3."""
    if 0.0 < density < _LIGHTEST:
        raise refusal(BenchBody, "density_kg_m3", density, source, _AS_SHOWN)
