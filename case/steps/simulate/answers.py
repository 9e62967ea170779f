"""Answers of a simulation: the truth, which no case folder holds."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray, IntArray, NumberArray
from palpate.core.files.atomic import atomic_path, writing
from palpate.core.mesh import cell_volumes
from palpate.core.statistics import rms
from palpate.core.surfaces.surface import Surface
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.labels import LABELS, ORGAN_LABELS
from palpate.imaging.volume import Volume
from palpate.simulate.hidden_figures import HiddenFigures
from palpate.simulate.solve import DeformedState
from palpate.simulate.stiffness import Stiffness
from palpate.simulate.strain_figures import SolverFigures

SURFACE_POINTS = 500


class Truth(TypedDict):
    """Truth of a simulated pair; lengths mm, moduli kPa, volumes cc.

    true_G_kpa, true_mu1_kpa, true_mu2_kpa, volume_cc : by label name. organ_strain : `strain_figures.organ_strain`.
    divide : distance of the surface between left and right from the plane of `_divide`; empty where there is no such
    surface. deformed_to_rest : (4, 4), LPS mm. hidden : what effects do that the specification hides; None where it hides none.
    """

    true_G_kpa: dict[str, float]
    true_mu1_kpa: dict[str, float]
    true_mu2_kpa: dict[str, float]
    tissue_G_kpa: float
    tissue_poisson_ratio: float
    organ_strain: dict[str, float]
    surface_displacement_rms_mm: float
    surface_displacement_max_mm: float
    divide: dict[str, float]
    volume_cc: dict[str, dict[str, float]]
    deformed_to_rest: list[list[float]]
    solver: SolverFigures
    hidden: HiddenFigures | None


class Answers(Truth):
    """NAME.json: the truth, and the specification as it was written."""

    name: str
    simulated: bool
    spec: dict[str, object]
    seed: int


def truth_of(state: DeformedState, stiffness: Stiffness, deformed_to_rest: FloatArray, seed: int) -> Truth:
    """Truth of a simulated pair as JSON data."""
    surface = surface_truth(state, seed)
    displacement = np.linalg.norm(surface["displacement"], axis=1)
    return {
        "true_G_kpa": {LABELS[label]: G for label, G in sorted(stiffness.organ.items())},
        "true_mu1_kpa": {LABELS[k]: 0.5 * G * stiffness.mu1_share for k, G in sorted(stiffness.organ.items())},
        "true_mu2_kpa": {LABELS[k]: 0.5 * G * (1 - stiffness.mu1_share) for k, G in sorted(stiffness.organ.items())},
        "tissue_G_kpa": stiffness.tissue,
        "tissue_poisson_ratio": stiffness.tissue_poisson_ratio,
        "organ_strain": state.strain,
        "surface_displacement_rms_mm": rms(displacement),
        "surface_displacement_max_mm": float(displacement.max()),
        "divide": _divide(state),
        "volume_cc": _volumes(state),
        "deformed_to_rest": deformed_to_rest.tolist(),
        "solver": state.solver,
        "hidden": state.hidden,
    }


def surface_truth(state: DeformedState, seed: int) -> dict[str, FloatArray | IntArray]:
    """Motion of up to 500 nodes of the organ's surface, and of all nodes of the walls (wall_NAME,
    wall_NAME_displacement).

    Arrays, all at rest in the rest frame: points (n, 3), displacement (n, 3) mm, unit outward normals (n, 3), region
    (n,).
    """
    mesh = state.space.mesh
    faces, owner_cell = mesh.region_boundary(ORGAN_LABELS)
    region = mesh.regions[owner_cell]
    triangles = Surface(mesh.points, faces, region)
    nodes_out = np.unique(faces)
    if len(nodes_out) > SURFACE_POINTS:
        nodes_out = np.sort(np.random.default_rng(seed).choice(nodes_out, SURFACE_POINTS, replace=False))
    owner = np.zeros(len(mesh.points), dtype=np.int64)
    owner[faces.ravel()] = np.repeat(region, 3)
    result: dict[str, FloatArray | IntArray] = {
        "points": mesh.points[nodes_out],
        "displacement": state.u[nodes_out],
        "normals": triangles.point_normals[nodes_out],
        "region": owner[nodes_out],
    }
    for name, nodes in state.boundary.items():
        if name in ("bladder", "rectum"):
            result[f"wall_{name}"] = state.space.nodes[nodes]
            result[f"wall_{name}_displacement"] = state.u[nodes]
    return result


def write_answers(
    folder: Path, name: str, truth: Answers, surface: Mapping[str, NumberArray], labels: dict[str, Volume]
) -> None:
    """Write NAME.json, NAME_surface.npz and NAME_labels/ (both states, rest frame, without noise) into the answers'
    folder.
    """
    import json

    with writing(folder / f"{name}.json"):
        folder.mkdir(parents=True, exist_ok=True)
    with atomic_path(folder / f"{name}_surface.npz") as temporary:
        np.savez_compressed(temporary, **surface)  # type: ignore[arg-type]
    for state, volume in labels.items():
        with atomic_path(folder / f"{name}_labels" / f"{state}.nii.gz") as temporary:
            write_labels(temporary, volume)
    with atomic_path(folder / f"{name}.json") as temporary:
        temporary.write_text(json.dumps(truth, indent=2, allow_nan=False) + "\n", encoding="utf-8")


def _volumes(state: DeformedState) -> dict[str, dict[str, float]]:
    """Volume of each organ region at rest and deformed, from the mesh."""
    mesh = state.space.mesh
    after = cell_volumes(mesh.points + state.u[: len(mesh.points)], mesh.cells)
    return {
        LABELS[label]: {
            "rest": float(mesh.volumes[mesh.regions == label].sum() / 1000.0),
            "deformed": float(after[mesh.regions == label].sum() / 1000.0),
        }
        for label in ORGAN_LABELS
        if (mesh.regions == label).any()
    }


def _divide(state: DeformedState) -> dict[str, float]:
    """Distance of the deformed surface between left and right from the plane x = centroid of the deformed organ; empty
    without one.
    """
    mesh = state.space.mesh
    both = [set(np.unique(mesh.cells[mesh.regions == label]).tolist()) for label in ORGAN_LABELS]
    shared = np.array(sorted(both[0] & both[1]), dtype=np.int64)
    if len(shared) == 0:
        return {}
    deformed = mesh.points + state.u[: len(mesh.points)]
    organ = np.isin(mesh.regions, ORGAN_LABELS)
    centroid = mesh.volumes[organ] @ deformed[mesh.cells[organ]].mean(axis=1) / mesh.volumes[organ].sum()
    distance = deformed[shared, 0] - centroid[0]
    return {"mean_mm": float(distance.mean()), "rms_mm": rms(distance)}
