"""The deformation of a case as a view that turns and plays."""

from __future__ import annotations

import numpy as np

from palpate.case.case_folder import CaseFolder
from palpate.case.meshed import load_meshed
from palpate.core.arrays import FloatArray
from palpate.imaging.labels import LABELS
from palpate.meshing.mesh_labels import MeshedCase
from palpate.ui.pictures.colours import STIFFNESS_SCALE, UNDETERMINED
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.interactive import MovingBody, deformation_page
from palpate.ui.pictures.solids import AROUND
from palpate.ui.report.document import Interactive

_CAPTION = (
    "The organ coloured by shear modulus (grey where this pair does not determine it), with the walls that push it; drag to turn, wheel "
    "to zoom, a click in the legend hides a body. Play moves everything along straight lines from rest to the identified "
    "model's deformed state, in true size; what happened between the two scans is not known. R right, L left, A anterior, P "
    "posterior, S superior, I inferior of the patient."
)


def moving_view(case: CaseFolder, images: CaseImages) -> Interactive:
    """The mesh of an identified case, from rest to the model's deformed state."""
    meshed = load_meshed(case)
    move = case.read_npz("identify/fields.npz")["mesh_displacement"]
    bodies = _organ(meshed, move, images) + _walls(meshed, move)
    return Interactive(deformation_page(bodies, STIFFNESS_SCALE if images.determined else None), _CAPTION)


def _organ(meshed: MeshedCase, move: FloatArray, images: CaseImages) -> list[MovingBody]:
    """One body for each region, so that a reader can hide one."""
    mesh = meshed.mesh
    regions = tuple(sorted(set(np.unique(mesh.regions).tolist()) & {1, 2}))
    faces, owners = mesh.region_boundary(regions)
    bodies = []
    for region in regions:
        here = faces[mesh.regions[owners] == region]
        colour = STIFFNESS_SCALE.rgb(images.determined[region]) if region in images.determined else UNDETERMINED
        name = LABELS[region].replace("_", " ")
        bodies.append(MovingBody.of(name, mesh.points, move, here, np.tile(colour, (len(here), 1)), 1.0))
    return bodies


def _walls(meshed: MeshedCase, move: FloatArray) -> list[MovingBody]:
    bodies = []
    for name, (r, g, b, opacity) in AROUND.items():
        # The mesh's normals point into the hollow: turned round, they point out of the organ that fills it.
        faces = meshed.boundary.get(name, np.zeros((0, 3), dtype=np.int64))[:, ::-1]
        if len(faces):
            rgb = np.tile([r, g, b], (len(faces), 1))
            bodies.append(MovingBody.of(name, meshed.mesh.points, move, faces, rgb, opacity))
    return bodies
