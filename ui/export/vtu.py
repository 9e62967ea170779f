"""For ParaView: the mesh at rest with regions, stiffness and the displacement that was found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyvista as pv

from palpate.case.case_folder import CaseFolder
from palpate.case.meshed import load_meshed
from palpate.core.files.atomic import atomic_path
from palpate.imaging.labels import SURROUNDING_TISSUE
from palpate.ui.export.stiffness import stiffness_of

WRITES = "VTK unstructured grid: region, G in kPa, displacement in mm"


def export(case: CaseFolder, folder: Path) -> list[Path]:
    """Writes mesh.vtu, LPS mm. Raises InputError when the case has no mesh, or where it cannot write."""
    mesh = load_meshed(case).mesh
    grid = pv.UnstructuredGrid({pv.CellType.TETRA: mesh.cells}, mesh.points)
    grid.cell_data["region"] = mesh.regions.astype(np.uint8)
    if case.has("result.json"):
        G = stiffness_of(case) | {SURROUNDING_TISSUE: case.facts.tissue_shear_modulus_kpa}
        grid.cell_data["G_kpa"] = np.array([G.get(int(region), np.nan) for region in mesh.regions])
    if case.has("identify/fields.npz"):
        grid.point_data["displacement_mm"] = case.read_npz("identify/fields.npz")["mesh_displacement"]
    with atomic_path(folder / "mesh.vtu") as path:
        grid.save(path)
    return [folder / "mesh.vtu"]
