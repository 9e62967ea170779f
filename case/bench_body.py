"""A case that is a body on a bench (docs/case.md): its mesh from the surface, its states from their points files."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyvista as pv

from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import read_landmarks
from palpate.core.arrays import IntArray
from palpate.core.diagnose.bench_bodies.problem import BODY, BodyProblem, BodyState, PointLoad
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh
from palpate.meshing.mesh_solid import mesh_solid

MESH = "body_mesh.npz"
# Standard deviation of a marker where the case does not say, mm per axis.
_MARKER_MM = 0.5


def is_body(case: CaseFolder) -> bool:
    """Whether the case is a body on a bench."""
    return "body" in case.facts.other


def body_inputs(case: CaseFolder) -> tuple[str, ...]:
    """Names of the files that such a case consists of. Raises InputError when a state names no points."""
    states = case.facts.other.get("states") or ()
    try:
        names = ("case.json", str(case.facts.other["body"]), *(str(s["points"]) for s in states))
    except (KeyError, TypeError) as error:
        raise InputError(
            f"{case.file('case.json')}: a state names no points file; write it as docs/case.md shows"
        ) from error
    if not all(name.isprintable() for name in names):
        raise InputError(f"{case.file('case.json')}: a file's name holds a line break; correct it")
    return names


def body_problem(case: CaseFolder) -> BodyProblem:
    """Read the case; mesh its body unless that was done.

    Raises InputError naming the file and what is wrong with it, ConvergenceError when the mesher fails.
    """
    facts = case.facts.other
    source = str(case.file("case.json"))
    states = facts.get("states")
    if not isinstance(states, list) or not states:
        raise InputError(f"{source}: a body needs states, at least one; write them as docs/case.md shows")
    mesh = _mesh(case)
    held = _held(mesh, facts, source)
    density = _density(facts, source)
    modelled = bool(facts.get("model_gravity", True))
    low, high = case.facts.organ_shear_modulus_bounds_kpa
    return BodyProblem(mesh, held, tuple(_state(case, s) for s in states), density, (low, high), modelled)


def _density(facts: Mapping[str, Any], source: str) -> float:
    try:
        density = float(facts.get("density_kg_m3", 1000.0))
    except (TypeError, ValueError) as error:
        raise InputError(f"{source}: density_kg_m3 is no number; correct it") from error
    if not 0.0 <= density < 1e6:
        raise InputError(f"{source}: density_kg_m3 is {density:g}; give a density in kg/m3")
    return density


def _state(case: CaseFolder, data: Mapping[str, Any]) -> BodyState:
    """points_sd_mm, per axis, may be given beside what docs/case.md lists."""
    try:
        points = read_landmarks(case.file(str(data["points"])))
        loads = tuple(PointLoad(_vector(x["at"]), _vector(x["force_n"])) for x in data.get("loads", ()))
        gravity = _vector(data.get("gravity", (0.0, 0.0, 0.0)))
        sd = float(data.get("points_sd_mm", case.facts.boundary_noise_sd_mm or _MARKER_MM))
        rest, deformed = (tuple(_vector(x) for x in at) for at in (points.rest, points.deformed))
        return BodyState(str(data["name"]), rest, deformed, sd, gravity, loads)
    except (KeyError, TypeError, ValueError) as error:
        source = case.file("case.json")
        raise InputError(f"{source}: a state is not written as docs/case.md shows ({error}); correct it") from error


def _vector(value: Any) -> tuple[float, float, float]:
    x, y, z = (float(v) for v in value)
    if not np.isfinite((x, y, z)).all():
        raise ValueError("a coordinate is not finite")
    return x, y, z


def _mesh(case: CaseFolder) -> TetMesh:
    if case.has(MESH):
        kept = case.read_npz(MESH)
        return TetMesh(kept["points"], kept["cells"], np.full(len(kept["cells"]), BODY))
    path = case.file(str(case.facts.other["body"]))
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


def _held(mesh: TetMesh, facts: Mapping[str, Any], source: str) -> IntArray:
    """(f, 3) faces whose corners all lie on a support's plane."""
    faces = mesh.boundary[0]
    X = mesh.points[faces]
    held = np.zeros(len(faces), dtype=bool)
    try:
        for support in facts.get("supports") or ():
            normal = np.array(_vector(support["plane_normal"]))
            normal = normal / max(np.abs(normal).max(), 1e-300)
            away = (X - np.array(_vector(support["plane_point"]))) @ (normal / max(np.linalg.norm(normal), 1e-9))
            held |= (np.abs(away) < float(support.get("tolerance_mm", 0.5))).all(axis=1)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{source}: a support is not written as docs/case.md shows ({error}); correct it") from error
    if not held.any():
        raise InputError(f"{source}: no face of the body lies on a support's plane; look at supports and tolerance_mm")
    return np.asarray(faces[held])
