"""Small asymmetric volumes and cases with known places, for pictures and reports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from palpate.case.case_folder import CaseFacts, CaseFolder
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume

CENTRE = np.array([-12.0, 30.0, -150.0])
# The bright marker lies to the patient's left, in front and above.
MARKER = CENTRE + np.array([18.0, -14.0, 15.0])
SPACING = np.array([2.0, 1.5, 3.0])


def affine(rotation_deg: float = 0.0, flips: tuple[int, int, int] = (1, 1, 1), order: str = "ijk") -> NDArray[Any]:
    """An affine whose grid of ``shape(order)`` voxels is centred on CENTRE: axes flipped, swapped, turned about an odd axis."""
    turn = Rotation.from_rotvec(np.deg2rad(rotation_deg) * np.array([0.3, 0.5, 0.81])).as_matrix()
    axes = turn @ np.diag(SPACING * np.array(flips))
    columns = axes[:, ["ijk".index(letter) for letter in order]]
    out = np.eye(4)
    out[:3, :3] = columns
    out[:3, 3] = CENTRE - columns @ (np.array(shape(order)) - 1) / 2.0
    return out


def shape(order: str = "ijk") -> tuple[int, ...]:
    """Voxels along each axis: about 100 mm of the patient whichever way they lie."""
    counts = {"i": 50, "j": 66, "k": 33}
    return tuple(counts[letter] for letter in order)


def lps(matrix: NDArray[Any], order: str = "ijk") -> NDArray[Any]:
    """Patient coordinates (..., 3) of every voxel."""
    index = np.stack(np.meshgrid(*map(np.arange, shape(order)), indexing="ij"), axis=-1)
    return index @ matrix[:3, :3].T + matrix[:3, 3]


def marked_ct(matrix: NDArray[Any], order: str = "ijk") -> Volume:
    """Water with one bright ball at MARKER."""
    far = np.linalg.norm(lps(matrix, order) - MARKER, axis=-1)
    return Volume(np.where(far < 7.0, 1000.0, 0.0).astype(np.float32), matrix)


def labels(matrix: NDArray[Any], order: str = "ijk", push_mm: float = 0.0) -> Volume:
    """Tissue, an organ split across x (1 left, 2 right) and a rectum behind it; push_mm moves the organ forward."""
    p = lps(matrix, order) - CENTRE
    out = np.where(np.abs(p).max(axis=-1) < 46.0, 3, 0).astype(np.uint8)
    organ = np.linalg.norm((p + [0.0, push_mm, 0.0]) / [18.0, 13.0, 15.0], axis=-1) < 1.0
    out[organ] = np.where(p[organ][:, 0] > 0.0, 1, 2)
    out[np.linalg.norm((p - [0.0, 27.0, 0.0])[..., :2], axis=-1) < 8.0] = 6
    return Volume(out, matrix)


def result(left: float = 120.0, right: float = 40.0, **changes: Any) -> dict[str, Any]:
    """A result.json in its form: an interval of about a fifth on both sides."""

    def region(G: float) -> dict[str, Any]:
        return {
            "G_kpa": G, "mu1_kpa": G / 4, "mu2_kpa": G / 4, "mu_mean_kpa": G / 4, "sd_kpa": 0.1 * G,
            "ci95_kpa": [G / 1.2, G * 1.2], "at_bound": False,
        }  # fmt: skip

    return {
        "parameters": {"prostate_left": region(left), "prostate_right": region(right)},
        "identifiability": {"singular_values": [9.0, 4.0], "mu1_mu2_separable": False, "verdict": "both are told"},
        "misfit": {"rms_mm": 0.41, "p95_mm": 0.83, "hausdorff_mm": 1.4, "objective_mm2": 150.0},
        "solver": {"forward_solves": 2000, "newton_iterations": 9000, "failed": 2, "seconds": 61.0},
        "method": "swarm", "boundary": "coupled", "seed": 7, "versions": {"palpate": "0.1.0", "numpy": "2.4.6"},
        "inputs_sha256": {"mesh.npz": "ab" * 32}, "convergence": [900.0, 400.0, 210.0, 200.0], "notes": [],
    } | changes  # fmt: skip


def write_case(folder: Path, found: dict[str, Any] | None = None, ct: bool = False, **facts: Any) -> CaseFolder:
    """A case with labels of both states and a result; with ``ct`` also a scan at rest of a patient with a name."""
    case = CaseFolder.create(folder, CaseFacts("asymmetric <case> & co", boundary_noise_sd_mm=0.4, **facts))
    matrix = affine()
    case.write_labels("rest", labels(matrix))
    case.write_labels("deformed", labels(matrix, push_mm=3.0))
    case.write_json("result.json", found or result())
    if ct:
        who = SeriesIdentity("4711-XYZ", "Doe^Jane", "s", "r", "f", 1, "study", "CT pelvis", "drawn by a test")
        write_ct_series(case.file("rest_ct"), marked_ct(matrix), who, compress=False)
    return case
