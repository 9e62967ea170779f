"""Numerical problem of a body on a bench (docs/case.md): mesh from its surface file, states from its marker files."""

from __future__ import annotations

import numpy as np
import pyvista as pv

from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import read_landmarks
from palpate.case.stated_files import MarkerState, Support, bench_body
from palpate.core.arrays import IntArray
from palpate.core.diagnose.bench_bodies.problem import BODY, BodyProblem, BodyState, PointLoad
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh
from palpate.meshing.mesh_solid import mesh_solid

MESH = "body_mesh.npz"
# Default standard deviation of a marker's position, mm per axis; an assumption.
_MARKER_MM = 0.5


def body_problem(case: CaseFolder) -> BodyProblem:
    """The body's mesh, held faces and states. The mesh is made on the first call and kept in the case as `MESH`.

    Raises InputError naming the file and what is wrong with it, ConvergenceError when the mesher fails.
    """
    body = bench_body(case)
    mesh = _mesh(case, body.body)
    held = _held_faces(mesh, body.supports or (), str(case.file("case.json")))
    states = tuple(_state(case, state) for state in body.states)
    bounds = case.facts.organ_shear_modulus_bounds_kpa
    return BodyProblem(mesh, held, states, body.density_kg_m3, bounds, body.model_gravity)


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


def _held_faces(mesh: TetMesh, supports: tuple[Support, ...], source: str) -> IntArray:
    """Boundary faces (f, 3) whose corners all lie on a support's plane. source : path of case.json, for the error."""
    faces = mesh.boundary[0]
    X = mesh.points[faces]
    held = np.zeros(len(faces), dtype=bool)
    for support in supports:
        normal = np.array(support.plane_normal)
        normal = normal / max(np.abs(normal).max(), 1e-300)
        distance = (X - np.array(support.plane_point)) @ (normal / max(np.linalg.norm(normal), 1e-9))
        held |= (np.abs(distance) < support.tolerance_mm).all(axis=1)
    if not held.any():
        raise InputError(f"{source}: no face of the body lies on a support's plane; look at supports and tolerance_mm")
    return np.asarray(faces[held])
