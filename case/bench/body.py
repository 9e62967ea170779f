"""Numerical problem of a body on a bench (docs/case.md): mesh from its surface file, states from its marker files."""

from __future__ import annotations

import numpy as np

from palpate.case.bench.patches import check_agreeing, check_held, held_faces, patches
from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.landmarks import COLUMNS, read_landmarks
from palpate.case.stated_files import BenchBody, MarkerState, bench_body, by_axis
from palpate.core.arrays import FloatArray
from palpate.core.diagnose.bench_bodies.problem import BODY, BodyProblem, BodyState, PointLoad
from palpate.core.errors import InputError
from palpate.core.forward.composition import PerAxis
from palpate.core.mesh import TetMesh
from palpate.imaging.surfaces.surface_files import read_closed_surface
from palpate.meshing.mesh_solid import CELLS, mesh_solid

MESH = "body_mesh.npz"
# Default standard deviation of a marker's position, mm per axis; an assumption.
_MARKER_MM = 0.5
_DEFORMED = COLUMNS[4:]


def body_problem(case: CaseFolder) -> BodyProblem:
    """The body's mesh, held faces and states. The mesh is kept in the case as `MESH` and made where that is of another
    surface or number of cells.

    Raises InputError naming the file and what is wrong with it, ConvergenceError when the mesher fails.
    """
    body, source = bench_body(case), str(case.file("case.json"))
    states = tuple(_state(case, state) for state in body.states)
    mesh = _mesh(case, body)
    supports = body.supports or ()
    held, every = held_faces(mesh, supports, source), patches(mesh, supports, body.states, source)
    if not supports and not every:
        raise InputError(f"{source}: no supports; say what holds the body")
    check_agreeing(held, every, [s.name for s in states], source)
    check_held(mesh, held, every, [s.name for s in states], source)
    bounds = case.facts.organ_shear_modulus_bounds_kpa
    return BodyProblem(mesh, held, states, body.density_kg_m3, bounds, body.model_gravity, tuple(every))


def _state(case: CaseFolder, state: MarkerState) -> BodyState:
    sd = _by_axis(state, case.facts.boundary_noise_sd_mm, str(case.file("case.json")))
    path = case.file(state.points)
    points = read_landmarks(path, [c for c, one in zip(_DEFORMED, sd, strict=True) if one is None], _DEFORMED)
    deformed = tuple(_seen(x, sd) for x in points.deformed)
    measured = any(force is not None for moved in state.moved for force in moved.reaction_n or ())
    if not measured and all(value is None for x in deformed for value in x):
        raise InputError(f"{path} shows no marker's motion along any axis with points_sd_mm; the state tells nothing")
    loads = tuple(PointLoad(load.at, load.force_n) for load in state.loads)
    rest = tuple((float(x), float(y), float(z)) for x, y, z in points.rest)
    return BodyState(state.name, rest, deformed, sd, state.gravity, loads, state.points_common)


def _by_axis(state: MarkerState, contour_noise_mm: float | None, source: str) -> PerAxis:
    """Standard deviation of the markers along each axis, None along one that is not seen."""
    stated = contour_noise_mm or _MARKER_MM if state.points_sd_mm is None else state.points_sd_mm
    return by_axis(stated, f"{source}: points_sd_mm of the state {state.name!r}")


def _seen(at: FloatArray, sd: PerAxis) -> PerAxis:
    x, y, z = (float(v) if np.isfinite(v) and one is not None else None for v, one in zip(at, sd, strict=True))
    return x, y, z


def _mesh(case: CaseFolder, body: BenchBody) -> TetMesh:
    path = case.file(body.body)
    if not path.is_file():
        raise InputError(f"{path} is not there; case.json names it as the body")
    made_from = np.frombuffer(f"{file_sha256(path)} {body.cells or CELLS}".encode(), dtype=np.uint8)
    if case.has(MESH):
        kept = case.read_npz(MESH)
        if np.array_equal(kept.get("made_from", np.zeros(0)), made_from):
            return TetMesh(kept["points"], kept["cells"], np.full(len(kept["cells"]), BODY))
    read = read_closed_surface(path)
    mesh = mesh_solid(read.surface.points, read.surface.faces, body.cells or CELLS, BODY)
    notes = np.frombuffer("\n".join(read.notes).encode(), dtype=np.uint8)
    case.write_npz(MESH, points=mesh.points, cells=mesh.cells, made_from=made_from, notes=notes)
    return mesh


def surface_notes(case: CaseFolder) -> list[str]:
    """What was mended or turned when the body's surface was meshed, one line each. Precondition: `body_problem` was called."""
    kept = case.read_npz(MESH).get("notes", np.zeros(0, dtype=np.uint8))
    return [f"{bench_body(case).body}: {line}" for line in kept.tobytes().decode().splitlines()]
