"""Body of a touch session: the organ of a case, with the identified stiffness, on a mesh of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from palpate.applications.touch.body import SUPPORTS, Body
from palpate.case.case_folder import CaseFolder
from palpate.case.identified import identified_regions, identified_shear
from palpate.case.problem import facts_of
from palpate.core.errors import InputError
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import LABELS, ORGAN_LABELS, OUTSIDE, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_labels import MeshOptions, mesh_labels

# Thickness of the tissue around the organ that the mesher needs; its cells are dropped.
_AROUND_MM = 14.0
# Mean volume of a cell over the cube of the requested edge, in the mesher's meshes (measured).
_CELL = 0.094


@dataclass(frozen=True)
class TouchStepOptions:
    """tets : approximate number of tetrahedra of the organ. support : key of `touch.body.SUPPORTS`."""

    tets: int = 4000
    support: str = "bed"


def body_of(case: CaseFolder, options: TouchStepOptions | None = None, progress: Progress = silent) -> Body:
    """Organ of a case at rest as a body to touch. Its mesh is kept in the case's folder `touch`.

    Raises InputError when the case has no stiffness or no labels at rest, or when they do not fit each other;
    ConvergenceError when the mesher fails.
    """
    options = options or TouchStepOptions()
    if options.support not in SUPPORTS:
        raise InputError(f"support {options.support!r} is unknown; choose one of {', '.join(SUPPORTS)}")
    if not case.has("result.json"):
        raise InputError(
            f"{case.file('result.json')} is not there; there is no stiffness to feel before `palpate identify`"
        )
    if not case.has_labels("rest"):
        raise InputError(f"{case.file('rest.nii.gz')} is not there; segment the scan at rest first")
    labels = organ_in_tissue(case.labels("rest"))
    regions = [r for r in ORGAN_LABELS if (labels.array == r).any()]
    stiffness = identified_shear(case, regions)
    progress(0.05, "mesh of the organ")
    volume = float(np.isin(labels.array, ORGAN_LABELS).sum() * np.prod(labels.spacing))
    edge = (volume / options.tets / _CELL) ** (1.0 / 3.0)
    meshed = mesh_labels(labels, MeshOptions(edge_mm=round(edge, 3)), case.file("touch") / "meshes")
    facts = facts_of(case)
    return Body(
        mesh=meshed.mesh.submesh(tuple(regions))[0],
        shear_kpa=stiffness,
        names={r: LABELS[r] for r in regions},
        support=options.support,
        tissue_kpa=facts.tissue_shear_modulus_kpa,
        poisson_ratio=facts.organ_poisson_ratio,
        interval_kpa=_intervals(case, regions),
    )


def organ_in_tissue(labels: Volume) -> Volume:
    """Labels of the organ and of a shell of tissue around it, cropped. Raises InputError when there is no organ
    voxel.
    """
    organ = np.isin(labels.array, ORGAN_LABELS)
    if not organ.any():
        raise InputError("the labels at rest contain no organ voxel (labels 1, 2); segment the scan at rest again")
    margin = np.ceil(_AROUND_MM / labels.spacing).astype(int) + 2
    index = np.argwhere(organ)
    low, high = index.min(axis=0), index.max(axis=0) + 1
    array = np.pad(labels.array[tuple(slice(a, b) for a, b in zip(low, high, strict=True))], [(m, m) for m in margin])
    organ = np.isin(array, ORGAN_LABELS)
    near = ndimage.distance_transform_edt(~organ, sampling=labels.spacing) < _AROUND_MM
    affine = labels.affine.copy()
    affine[:3, 3] = labels.to_lps((low - margin)[None])[0]
    out = np.where(organ, array, np.where(near, SURROUNDING_TISSUE, OUTSIDE)).astype(np.uint8)
    return Volume(out, affine)


def _intervals(case: CaseFolder, regions: list[int]) -> dict[int, tuple[float, float]]:
    named = identified_regions(case)
    intervals = {r: named[LABELS[r]].ci95_kpa for r in regions}
    return {r: interval for r, interval in intervals.items() if interval is not None}
