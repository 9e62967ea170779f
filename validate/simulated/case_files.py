"""A case folder of two simulated states, with voxels or without, with contour errors or without; and the truth beside it."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.case.meshed import load_meshed
from palpate.case.steps import mesh
from palpate.core.arrays import FloatArray, NumberArray
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_file import mesh_arrays
from palpate.meshing.mesh_labels import MeshOptions
from palpate.meshing.partition import HOLE_NAMES
from palpate.validate.simulated.contour_noise import STATES, STRUCTURES, ContourErrors
from palpate.validate.simulated.drawing import Drawing
from palpate.validate.simulated.exact_mesh import on_contours
from palpate.validate.simulated.two_states import TwoStates


@dataclass(frozen=True, eq=False)
class CasePlan:
    """How a pair is drawn. voxel_mm : of the label volumes. facts : what case.json says. mesh : options of the mesh."""

    voxel_mm: tuple[float, float, float]
    facts: CaseFacts
    mesh: MeshOptions


def write_case(path: Path, states: TwoStates, errors: ContourErrors, plan: CasePlan, exact: Path | None = None) -> None:
    """Write a meshed case. exact : path of a copy of it whose surfaces and mesh's boundary lie on the contours themselves, not on the
    voxels' smooth surfaces.

    Raises InputError or ConvergenceError when the labels cannot be meshed.
    """
    case = CaseFolder.create(path, plan.facts)
    drawings = {state: Drawing(states, errors, state) for state in STATES}
    grid = states.grid(plan.voxel_mm)
    volumes = {state: drawing.volume(grid) for state, drawing in drawings.items()}
    for state, volume in volumes.items():
        case.write_labels(state, volume)
    mesh.run(case, plan.mesh)
    if exact is not None:
        shutil.rmtree(exact, ignore_errors=True)
        shutil.copytree(path, exact)
        _replace(CaseFolder(exact), drawings, volumes)


def _replace(case: CaseFolder, drawings: Mapping[str, Drawing], volumes: Mapping[str, Volume]) -> None:
    """Write the mesh step's files anew, from the contours."""
    structures = ("organ", *HOLE_NAMES.values())
    made = on_contours(load_meshed(case), {name: drawings["rest"].inside(name) for name in structures})
    case.write_npz("mesh.npz", **mesh_arrays(made.mesh, made.boundary))
    arrays: dict[str, NumberArray] = {}
    for state, drawing in drawings.items():
        for name, surface in drawing.surfaces(volumes[state]).items():
            key = f"{state}_{name}"
            arrays |= {f"{key}_points": surface.points, f"{key}_faces": surface.faces, f"{key}_region": surface.region}
            if name == "organ":
                arrays[f"{key}_rim"] = surface.rim
    case.write_npz("surfaces.npz", **arrays)


def truth_arrays(
    states: TwoStates, errors: ContourErrors, voxel_mm: tuple[float, float, float]
) -> dict[str, NumberArray]:
    """What is exactly so: for organ, bladder and rectum NAME_points (n, 3) mm on the surface at rest without noise, NAME_faces (f, 3),
    NAME_region (f,), NAME_normals (n, 3) outwards, NAME_displacement (n, 3) mm of those points of the body, NAME_rest_error and
    NAME_deformed_error (n,) mm by which the contours of both scans lie too far out there (to first order).

    And, since a wall may slide along itself, NAME_deformed_points and NAME_deformed_faces: the same surfaces in the deformed state.
    """
    clean, grid = ContourErrors.none(), states.grid(voxel_mm)
    rest, deformed = (Drawing(states, clean, state) for state in STATES)
    at_rest, after = rest.surfaces(rest.volume(grid)), deformed.surfaces(deformed.volume(grid))
    out: dict[str, NumberArray] = {}
    for name in STRUCTURES:
        if name not in at_rest or name not in after:
            continue
        surface = at_rest[name]
        u = states.displacement(surface.points)
        moved = surface.with_points(surface.points + u)
        out |= {f"{name}_points": surface.points, f"{name}_faces": surface.faces, f"{name}_region": surface.region}
        out |= {f"{name}_normals": surface.point_normals, f"{name}_displacement": u}
        out[f"{name}_rest_error"] = _outwards(errors, "rest", name, surface.points, surface.point_normals)
        out[f"{name}_deformed_error"] = _outwards(errors, "deformed", name, moved.points, moved.point_normals)
        out |= {f"{name}_deformed_points": after[name].points, f"{name}_deformed_faces": after[name].faces}
    return out


def _outwards(errors: ContourErrors, state: str, name: str, points: FloatArray, normals: FloatArray) -> FloatArray:
    """A label is asked for at x + e(x): the contour then lies at x - e(x)."""
    return np.asarray(-(errors.fields[state, name](points) * normals).sum(axis=1))
