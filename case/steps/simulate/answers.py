"""The answers of a simulation: what the case never holds."""

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
from palpate.simulate.solve import DeformedState, Stiffness
from palpate.simulate.strain_figures import SolverFigures

SURFACE_POINTS = 500


class Truth(TypedDict):
    """Everything known of a simulated pair; lengths mm, moduli kPa, volumes cc.

    true_G_kpa, true_mu1_kpa, true_mu2_kpa, volume_cc : by label name. organ_strain : `strain_figures.organ_strain`. divide : how far the
    surface between left and right is from the plane of `_divide`; empty where there is none. deformed_to_rest : (4, 4), LPS mm.
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


class Answers(Truth):
    """NAME.json: the truth, and the spec (as it was written) that it was simulated from."""

    name: str
    simulated: bool
    spec: dict[str, object]
    seed: int


def truth_of(state: DeformedState, stiffness: Stiffness, deformed_to_rest: FloatArray, seed: int) -> Truth:
    """Everything known of a simulated pair, ready for JSON; lengths mm, moduli kPa, volumes cc."""
    surface = surface_truth(state, seed)
    moved = np.linalg.norm(surface["displacement"], axis=1)
    return {
        "true_G_kpa": {LABELS[label]: G for label, G in sorted(stiffness.organ.items())},
        "true_mu1_kpa": {LABELS[k]: 0.5 * G * stiffness.mu1_share for k, G in sorted(stiffness.organ.items())},
        "true_mu2_kpa": {LABELS[k]: 0.5 * G * (1 - stiffness.mu1_share) for k, G in sorted(stiffness.organ.items())},
        "tissue_G_kpa": stiffness.tissue,
        "tissue_poisson_ratio": stiffness.tissue_poisson_ratio,
        "organ_strain": state.strain,
        "surface_displacement_rms_mm": rms(moved),
        "surface_displacement_max_mm": float(moved.max()),
        "divide": _divide(state),
        "volume_cc": _volumes(state),
        "deformed_to_rest": deformed_to_rest.tolist(),
        "solver": state.solver,
    }


def surface_truth(state: DeformedState, seed: int) -> dict[str, FloatArray | IntArray]:
    """Up to 500 nodes of the organ's surface and all of the walls' (keys wall_NAME, wall_NAME_displacement): points
    (n, 3), displacement (n, 3) mm, unit outward normal (n, 3), region (n,), all at rest in the rest frame.
    """
    mesh = state.space.mesh
    faces, owner_cell = mesh.region_boundary(ORGAN_LABELS)
    region = mesh.regions[owner_cell]
    triangles = Surface(mesh.points, faces, region)
    chosen = np.unique(faces)
    if len(chosen) > SURFACE_POINTS:
        chosen = np.sort(np.random.default_rng(seed).choice(chosen, SURFACE_POINTS, replace=False))
    owner = np.zeros(len(mesh.points), dtype=np.int64)
    owner[faces.ravel()] = np.repeat(region, 3)
    result: dict[str, FloatArray | IntArray] = {
        "points": mesh.points[chosen],
        "displacement": state.u[chosen],
        "normals": triangles.point_normals[chosen],
        "region": owner[chosen],
    }
    for name, nodes in state.boundary.items():
        if name in ("bladder", "rectum"):
            result[f"wall_{name}"] = state.space.nodes[nodes]
            result[f"wall_{name}_displacement"] = state.u[nodes]
    return result


def write_answers(
    folder: Path, name: str, truth: Answers, surface: Mapping[str, NumberArray], labels: dict[str, Volume]
) -> None:
    """Writes NAME.json, NAME_surface.npz and NAME_labels/ (both states, rest frame, without noise) in the answers' folder."""
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
    """How far the surface between left and right, carried along, is from the plane x = centroid of the deformed organ."""
    mesh = state.space.mesh
    both = [set(np.unique(mesh.cells[mesh.regions == label]).tolist()) for label in ORGAN_LABELS]
    shared = np.array(sorted(both[0] & both[1]), dtype=np.int64)
    if len(shared) == 0:
        return {}
    moved = mesh.points + state.u[: len(mesh.points)]
    organ = np.isin(mesh.regions, ORGAN_LABELS)
    centroid = mesh.volumes[organ] @ moved[mesh.cells[organ]].mean(axis=1) / mesh.volumes[organ].sum()
    away = moved[shared, 0] - centroid[0]
    return {"mean_mm": float(away.mean()), "rms_mm": rms(away)}
