"""The mesh step of a case: labels of both states to mesh, surfaces and quality figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import numpy as np
import pyvista as pv

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.imported import holds_rest_alone
from palpate.case.meshed import ORGAN_NAME, MeshReport, load_meshed
from palpate.case.rigid_offset import rigid_offset_in
from palpate.case.slimmed import slim_files
from palpate.case.steps.declarations import MESH
from palpate.core.arrays import NumberArray
from palpate.core.errors import InputError
from palpate.core.mesh import TetMesh
from palpate.core.worker.progress import Progress, silent
from palpate.core.worker.threads import beside
from palpate.imaging.contours.detached_parts import detached_notes
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import organ_surfaces, wall_surface
from palpate.meshing.mesh_file import Recipe, mesh_arrays, recipe_hash
from palpate.meshing.mesh_labels import MeshedCase, MeshOptions, mesh_labels
from palpate.meshing.partition import HOLE_NAMES, HOLLOW_NAMES
from palpate.meshing.voxel_errors import organ_voxel_errors, wall_voxel_errors

# Number of the form of surfaces.npz: those of another one are made again.
SURFACES, SURFACES_FILE = 2, "surfaces.npz"


def run(case: CaseFolder, options: MeshOptions | None = None, progress: Progress = silent) -> MeshReport:
    """Write mesh.npz, surfaces.npz, mesh.json and mesh.vtu of a case; return what mesh.json says.

    Surfaces of both states are in the frame of the scan at rest. Scans that nobody has aligned are aligned here
    (`laid_elsewhere`). The step passes over a case whose labels and options are those of the last run. The mesh depends
    on the rest labels only and is kept when only the deformed labels have changed: outside Linux the mesher does not
    repeat a mesh.

    Raises InputError when labels are missing or cannot be meshed, ConvergenceError when the mesher fails.
    """
    options = options or MeshOptions()
    made_from = MESH.made_from(case, chosen(options))
    if MESH.is_done(case, made_from) and SURFACES_FILE not in slim_files(case):
        kept: MeshReport = case.read_json("mesh.json")
        return kept
    _require_labels(case)
    rest, deformed = case.labels("rest"), case.labels("deformed")
    offset = rigid_offset_in(case, deformed)
    if offset is not None:
        deformed = deformed.moved(offset.deformed_to_rest)
    progress(0.02, "smooth surfaces and tetrahedra")
    # The mesher is a process of its own: what is left of the surfaces is drawn while it works.
    with beside(lambda one: surface_arrays(*one), [("rest", rest), ("deformed", deformed)]) as surfaces:
        meshed = _kept_mesh(case, rest, options) or mesh_labels(rest, options)
        arrays = {name: array for state in surfaces() for name, array in state.items()}
    progress(0.9, "writing the mesh")
    _write(case, meshed, arrays)
    report: MeshReport = {
        **meshed.quality,
        "inputs_sha256": made_from.sha256,
        "mesh_sha256": file_sha256(case.file("mesh.npz")),
        "options": asdict(options),
        "notes": _notes(rest, deformed),
        "laid_elsewhere": None if offset is None else offset.to_dict(),
        "surface_faces": {key[: -len("_faces")]: len(a) for key, a in arrays.items() if key.endswith("_faces")},
    }
    case.write_json("mesh.json", report)
    MESH.mark_done(case, made_from)
    progress(1.0, f"{len(meshed.mesh.cells)} cells")
    return report


def _write(case: CaseFolder, meshed: MeshedCase, surfaces: Mapping[str, NumberArray]) -> None:
    """The mesh for the program and for a viewer, and the surfaces of both states."""
    case.write_npz("mesh.npz", **mesh_arrays(meshed.mesh, meshed.boundary))
    case.write_npz(SURFACES_FILE, **surfaces)
    with case.atomic_path("mesh.vtu") as path:
        _view(meshed.mesh).save(path)


def _notes(rest: Volume, deformed: Volume) -> list[str]:
    """What the labels of each state have that is not meshed."""
    return [f"{s}: {n}" for s, labels in (("rest", rest), ("deformed", deformed)) for n in detached_notes(labels)]


def _require_labels(case: CaseFolder) -> None:
    """Raises InputError where a state has none."""
    for state in ("rest", "deformed"):
        if state == "deformed" and case.has("import.json") and holds_rest_alone(case):
            raise InputError(
                f"{case.path} contains only the scan at rest; `palpate plan` works on it, or import both scans"
            )
        if not case.has_labels(state):
            raise InputError(f"{case.file(state + '.nii.gz')} is not there; run `palpate segment` or put labels there")


def chosen(options: MeshOptions) -> dict[str, object]:
    """All that changes the result beside the case's files."""
    return asdict(options) | {"surfaces": SURFACES}


def surface_arrays(state: str, labels: Volume) -> dict[str, NumberArray]:
    """Arrays of the surfaces of one state: STATE_NAME_points (n, 3) mm, STATE_NAME_faces (f, 3), STATE_NAME_region
    (f,).

    NAME is organ, bone, bladder or rectum; absent labels are left out. STATE_organ_rim holds the points where organ
    regions meet, STATE_NAME_voxel_errors (m, n) mm what voxels make points err by (`meshing.voxel_errors`), bone left out.
    """
    surfaces = {ORGAN_NAME: organ_surfaces(labels)}
    surfaces |= {name: wall_surface(labels, label) for label, name in HOLE_NAMES.items()}
    organ = surfaces[ORGAN_NAME]
    arrays: dict[str, NumberArray] = {
        f"{state}_{ORGAN_NAME}_rim": organ.rim,
        f"{state}_{ORGAN_NAME}_voxel_errors": organ_voxel_errors(labels, organ.points).astype(np.float32),
    }
    for name, surface in surfaces.items():
        if len(surface.faces):
            prefix = f"{state}_{name}"
            arrays[f"{prefix}_points"] = surface.points
            arrays[f"{prefix}_faces"] = surface.faces
            arrays[f"{prefix}_region"] = surface.region
    for label, name in HOLLOW_NAMES.items():
        if len(surfaces[name].faces):
            errors = wall_voxel_errors(labels, label, surfaces[name].points)
            arrays[f"{state}_{name}_voxel_errors"] = errors.astype(np.float32)
    return arrays


def _kept_mesh(case: CaseFolder, rest: Volume, options: MeshOptions) -> MeshedCase | None:
    """The mesh already in the case, when it was made from the same labels and options."""
    if not (case.has("mesh.npz") and case.has("mesh.json")):
        return None
    kept = load_meshed(case)
    made_from = recipe_hash(Recipe(rest, asdict(options)))
    same = kept.quality.get("recipe_sha256") == made_from
    # A run killed between the two files leaves a mesh that its mesh.json does not describe.
    whole = kept.quality.get("mesh_sha256") == file_sha256(case.file("mesh.npz"))
    return kept if same and whole else None


def _view(mesh: TetMesh) -> pv.UnstructuredGrid:
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: mesh.cells}, mesh.points)
    grid.cell_data["region"] = mesh.regions.astype(np.uint8)
    return grid
