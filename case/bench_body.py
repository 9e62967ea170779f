"""A case that is a body on a bench (docs/case.md): its mesh from the surface, its states from their points files."""

from __future__ import annotations

from typing import Annotated

import msgspec
import numpy as np
import pyvista as pv
from msgspec import Meta

from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import read_landmarks
from palpate.core.arrays import IntArray
from palpate.core.diagnose.bench_bodies.problem import BODY, BodyProblem, BodyState, PointLoad
from palpate.core.errors import InputError
from palpate.core.files.json_types import typed
from palpate.core.mesh import TetMesh
from palpate.meshing.mesh_solid import mesh_solid

MESH = "body_mesh.npz"
# Standard deviation of a marker where the case does not say, mm per axis.
_MARKER_MM = 0.5


# Bounds that only keep infinity and NaN out: mm, m/s2, N.
_Number = Annotated[float, Meta(ge=-1e9, le=1e9)]
_Vector = tuple[_Number, _Number, _Number]
_AS_SHOWN = "; write it as docs/case.md shows"


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


def body_problem(case: CaseFolder) -> BodyProblem:
    """Read the case; mesh its body unless that was done.

    Raises InputError naming the file and what is wrong with it, ConvergenceError when the mesher fails.
    """
    found = bench_body(case)
    mesh = _mesh(case, found.body)
    held = _held(mesh, found.supports or (), str(case.file("case.json")))
    states = tuple(_state(case, state) for state in found.states)
    bounds = case.facts.organ_shear_modulus_bounds_kpa
    return BodyProblem(mesh, held, states, found.density_kg_m3, bounds, found.model_gravity)


def _state(case: CaseFolder, state: MarkerState) -> BodyState:
    points = read_landmarks(case.file(state.points))
    loads = tuple(PointLoad(load.at, load.force_n) for load in state.loads)
    sd = state.points_sd_mm or case.facts.boundary_noise_sd_mm or _MARKER_MM
    rest, deformed = (tuple((float(x), float(y), float(z)) for x, y, z in at) for at in (points.rest, points.deformed))
    return BodyState(state.name, rest, deformed, sd, state.gravity, loads)


def _mesh(case: CaseFolder, body: str) -> TetMesh:
    if case.has(MESH):
        kept = case.read_npz(MESH)
        return TetMesh(kept["points"], kept["cells"], np.full(len(kept["cells"]), BODY))
    path = case.file(body)
    if not path.is_file():
        raise InputError(f"{path} is not there; case.json names it as the body")
    try:
        with pv.vtk_verbosity("off"):
            surface = pv.read(path).triangulate().clean()
    except (OSError, ValueError, RuntimeError, AttributeError) as error:
        raise InputError(f"{path} is not readable as a surface; save it again as STL, OBJ or PLY") from error
    points = np.asarray(surface.points, dtype=np.float64)
    faces = np.asarray(surface.faces, dtype=np.int64).reshape(-1, 4)[:, 1:]
    if surface.n_open_edges or not surface.volume > 0.0:
        raise InputError(f"{path} is not a closed surface; mend it")
    mesh = mesh_solid(points, faces, region=BODY)
    case.write_npz(MESH, points=mesh.points, cells=mesh.cells)
    return mesh


def _held(mesh: TetMesh, supports: tuple[Support, ...], source: str) -> IntArray:
    """(f, 3) faces whose corners all lie on a support's plane."""
    faces = mesh.boundary[0]
    X = mesh.points[faces]
    held = np.zeros(len(faces), dtype=bool)
    for support in supports:
        normal = np.array(support.plane_normal)
        normal = normal / max(np.abs(normal).max(), 1e-300)
        away = (X - np.array(support.plane_point)) @ (normal / max(np.linalg.norm(normal), 1e-9))
        held |= (np.abs(away) < support.tolerance_mm).all(axis=1)
    if not held.any():
        raise InputError(f"{source}: no face of the body lies on a support's plane; look at supports and tolerance_mm")
    return np.asarray(faces[held])
