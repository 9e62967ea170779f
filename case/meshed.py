"""The mesh and the surfaces of a case, as the mesh step has left them."""

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

    inputs_sha256, mesh_sha256 : of what it was made from, and of mesh.npz. options : by name. laid_elsewhere : null where the deformed
    scan lay in place. surface_faces : number of triangles by STATE_NAME.
    """

    inputs_sha256: str
    mesh_sha256: str
    options: dict[str, float | None]
    notes: list[str]
    laid_elsewhere: OffsetRecord | None
    surface_faces: dict[str, int]


def load_meshed(case: CaseFolder) -> MeshedCase:
    """The mesh of a case with its named boundary and quality. Raises InputError when the mesh step has not been run."""
    quality: MeshReport = case.read_json("mesh.json")
    mesh, boundary, _ = load_mesh(case.file("mesh.npz"))
    return MeshedCase(mesh, boundary, quality)


def elsewhere_of(case: CaseFolder) -> RigidOffset | None:
    """How the deformed scan of a meshed case lay elsewhere; its surfaces no longer do."""
    report: MeshReport = case.read_json("mesh.json")
    found = report.get("laid_elsewhere")
    return None if found is None else RigidOffset.from_dict(found)


def load_surfaces(case: CaseFolder, state: str) -> dict[str, Surface]:
    """The surfaces of one state ("rest" or "deformed") by name: "organ", and the walls that the case has."""
    arrays = case.read_npz("surfaces.npz")
    names = [key[len(state) + 1 : -len("_faces")] for key in arrays if key.startswith(state) and key.endswith("_faces")]
    return {n: Surface(*(arrays[f"{state}_{n}_{part}"] for part in ("points", "faces", "region"))) for n in names}
