"""Mesh and surfaces of a case, written by the mesh step."""

from __future__ import annotations

from palpate.case.case_folder import CaseFolder
from palpate.case.rigid_offset import OffsetRecord, RigidOffset
from palpate.core.surfaces.surface import Surface
from palpate.meshing.mesh_file import load_mesh
from palpate.meshing.mesh_labels import MeshedCase
from palpate.meshing.quality import MeshQuality

ORGAN_NAME = "organ"


class MeshReport(MeshQuality, total=False):
    """mesh.json: the mesh's quality, then what the mesh step adds to it.

    inputs_sha256, mesh_sha256 : of what it was made from, and of mesh.npz. options : by name. laid_elsewhere : null
    where the deformed scan lay in place. surface_faces : number of triangles by STATE_NAME.
    """

    inputs_sha256: str
    mesh_sha256: str
    options: dict[str, float | None]
    notes: list[str]
    laid_elsewhere: OffsetRecord | None
    surface_faces: dict[str, int]


def load_meshed(case: CaseFolder) -> MeshedCase:
    """Mesh, boundary faces by name, and content of mesh.json. Raises InputError when the mesh step has not been run."""
    quality: MeshReport = case.read_json("mesh.json")
    mesh, boundary, _ = load_mesh(case.file("mesh.npz"))
    return MeshedCase(mesh, boundary, quality)


def rigid_offset_of(case: CaseFolder) -> RigidOffset | None:
    """Rigid offset of the deformed scan that the mesh step removed; None where the scans were aligned.

    The surfaces of the case are already in the rest frame. Raises InputError when mesh.json is missing or damaged.
    """
    report: MeshReport = case.read_json("mesh.json")
    entry = report.get("laid_elsewhere")
    return None if entry is None else RigidOffset.from_dict(entry)


def load_surfaces(case: CaseFolder, state: str) -> dict[str, Surface]:
    """Surfaces of one state ("rest" or "deformed") by name, rest frame, mm: "organ", "bone", "bladder", "rectum".

    Surfaces that the labels do not show are left out. Raises InputError when surfaces.npz is missing or damaged.
    """
    arrays = case.read_npz("surfaces.npz")
    names = [key[len(state) + 1 : -len("_faces")] for key in arrays if key.startswith(state) and key.endswith("_faces")]
    found = {}
    for name in names:
        points, faces, region = (arrays[f"{state}_{name}_{part}"] for part in ("points", "faces", "region"))
        found[name] = Surface(points, faces, region, voxel_errors=arrays.get(f"{state}_{name}_voxel_errors"))
    return found
