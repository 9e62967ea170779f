"""Import of a pair of closed surfaces, from photogrammetry or a segmentation, into a case folder."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyvista as pv
from scipy import ndimage

from palpate.case.case_folder import STATES, CaseFolder, check_new_case, file_sha256
from palpate.case.landmarks import Landmarks, read_landmarks
from palpate.case.problem import problem_of
from palpate.case.step_records import SurfacesRecord
from palpate.case.steps import mesh
from palpate.case.steps.declarations import IMPORT
from palpate.case.steps.import_scans.options import check_file
from palpate.case.steps.import_scans.write import open_or_create, write_landmarks
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.core.identify.pair.no_driving_wall import NEXT, moved_by_its_surface
from palpate.core.identify.pair.surface_alignment import aligned
from palpate.core.problem import SurfacePair
from palpate.core.surfaces.rigid_motion import transformed
from palpate.core.surfaces.surface import Surface
from palpate.core.worker.progress import Progress, silent
from palpate.imaging.labels import ORGAN_LABELS, SURROUNDING_TISSUE
from palpate.imaging.surfaces.surface_files import ReadSurface, read_closed_surface
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_labels import MeshOptions

SUMMARY = "surfaces.json"
# Number of voxels across the organ, and bounds of the voxel's edge, mm.
_ACROSS, _FINEST_MM, _COARSEST_MM = 55, 0.5, 2.0
# Thickness, mm, of the layer of tissue that mesh and pictures need around the organ; nothing is known of it.
_AROUND_MM = 12.0
# Largest ratio of the two volumes; a larger one is taken for an error, such as a wrong unit.
_LIKELY_FACTOR = 1.6


@dataclass(frozen=True)
class SurfaceImportOptions:
    """name : of the case; None for that of the folder. landmarks : CSV of matched points, each in its own surface's
    frame.

    align : False where both surfaces are in one frame already. cells : approximate number of tetrahedra.
    """

    name: str | None = None
    landmarks: Path | None = None
    align: bool = True
    cells: int = 4000


def run_surface_import(
    rest: Path,
    deformed: Path,
    case_path: Path,
    options: SurfaceImportOptions | None = None,
    progress: Progress = silent,
) -> SurfacesRecord:
    """Make the case of two closed surfaces (STL, OBJ, PLY), and compute what such a pair tells.

    Returns the content of surfaces.json. Both surfaces are read, mended and checked before anything is written. A rerun
    with the same inputs does nothing. Raises InputError (file, what, remedy), ConvergenceError.
    """
    options = options or SurfaceImportOptions()
    check_new_case(case_path)
    inputs = _inputs(rest, deformed, options)
    earlier = _earlier(case_path, inputs)
    if earlier is not None:
        progress(1.0, "already imported")
        return earlier
    progress(0.02, "reading the surfaces")
    surfaces = [read_closed_surface(path) for path in (rest, deformed)]
    _check_volumes((rest, deformed), surfaces)
    points = read_landmarks(options.landmarks) if options.landmarks else None
    progress(0.2, "aligning")
    pair = SurfacePair(surfaces[0].surface, surfaces[1].surface)
    matrix = aligned(pair) if options.align else np.eye(4)
    progress(0.3, "writing the case")
    case = open_or_create(case_path, options.name, [None, None])
    # First, so that a rerun after a kill may go on.
    case.write_json("import.json", {"case": str(case.path), "sources_sha256": inputs})
    _write(case, surfaces, matrix)
    outputs = ["case.json", "alignment.json", "rest.nii.gz", "deformed.nii.gz", "labels.txt"]
    outputs += write_landmarks(case, points, matrix)
    mesh.run(case, MeshOptions(target_tets=options.cells), lambda f, m: progress(0.35 + 0.45 * f, m))
    progress(0.85, "moving the inside with the surface")
    summary = _summary(case, surfaces, matrix, points)
    case.write_json(SUMMARY, summary)
    case.write_json("import.json", {"case": str(case.path), "sources_sha256": inputs, "notes": summary["notes"]})
    case.mark_done(IMPORT.name, _hash(inputs), [*outputs, SUMMARY, "import.json"])
    progress(1.0, "imported")
    return summary


def _write(case: CaseFolder, surfaces: list[ReadSurface], matrix: FloatArray) -> None:
    case.write_json("alignment.json", {"deformed_to_rest": matrix, "residual_mm": None})
    in_rest_frame = [np.eye(4), matrix]
    for state, one, transform in zip(STATES, surfaces, in_rest_frame, strict=True):
        aligned_surface = one.surface.with_points(transformed(transform, one.surface.points))
        case.write_labels(state, labels_of(aligned_surface))


def labels_of(surface: Surface) -> Volume:
    """Label volume of one closed surface: 1 (organ) inside, 3 (tissue) in a layer around it, 0 beyond."""
    h = float(np.clip(np.ptp(surface.points, axis=0).max() / _ACROSS, _FINEST_MM, _COARSEST_MM))
    low = surface.points.min(axis=0) - _AROUND_MM - 3.0 * h
    shape = np.ceil((surface.points.max(axis=0) + _AROUND_MM + 3.0 * h - low) / h).astype(int) + 1
    grid = pv.ImageData(dimensions=tuple(shape), spacing=(h, h, h), origin=tuple(low))
    counted = np.column_stack([np.full(len(surface.faces), 3), surface.faces])
    body = pv.PolyData(surface.points, faces=counted.ravel())
    mask = body.voxelize_binary_mask(reference_volume=grid, foreground_value=1, background_value=0)
    inside = np.asarray(mask.point_data["mask"]).reshape(shape, order="F") > 0
    near = ndimage.distance_transform_edt(~inside, sampling=h) < _AROUND_MM
    affine = np.diag([h, h, h, 1.0])
    affine[:3, 3] = low
    return Volume(np.where(inside, ORGAN_LABELS[0], np.where(near, SURROUNDING_TISSUE, 0)).astype(np.uint8), affine)


def _summary(
    case: CaseFolder, surfaces: list[ReadSurface], matrix: FloatArray, points: Landmarks | None
) -> SurfacesRecord:
    untold = moved_by_its_surface(problem_of(case))
    volumes = {s: one.surface.enclosed_volume / 1000.0 for s, one in zip(STATES, surfaces, strict=True)}
    turn = float(np.degrees(np.arccos(np.clip((np.trace(matrix[:3, :3]) - 1.0) / 2.0, -1.0, 1.0))))
    notes = [f"{state}: {note}" for state, one in zip(STATES, surfaces, strict=True) for note in one.notes]
    notes.append(
        "the layer of tissue in the label volumes is a filling that mesh and pictures need; nothing is known of it"
    )
    return {
        "case": str(case.path),
        "volume_cc": {state: round(v, 3) for state, v in volumes.items()},
        "turned_deg": round(turn, 2),
        "surface_rms_mm": dict(untold.surface_mm or {}),
        "landmarks": None if untold.landmarks is None else {way: plain(d) for way, d in untold.landmarks.items()},
        "cannot_tell": untold.in_words,
        "next": NEXT,
        "in_words": list(untold.notes[1:]),
        "notes": notes,
        "landmarks_as_given_rms_mm": _as_given(points),
    }


def _as_given(points: Landmarks | None) -> float | None:
    """Rms distance, mm, of the landmarks without any alignment; None without landmarks."""
    if points is None:
        return None
    return round(float(np.sqrt(((points.rest - points.deformed) ** 2).sum(axis=1).mean())), 3)


def _check_volumes(paths: tuple[Path, Path], surfaces: list[ReadSurface]) -> None:
    volumes = [one.surface.enclosed_volume for one in surfaces]
    factor = max(volumes) / min(volumes)
    if factor > _LIKELY_FACTOR:
        raise InputError(
            f"{paths[0]} encloses {volumes[0] / 1000:.3g} cc and {paths[1]} {volumes[1] / 1000:.3g} cc, a factor of {factor:.3g}; up to "
            f"{_LIKELY_FACTOR:g} is taken for one body: give two surfaces of one body, both in mm"
        )


def _inputs(rest: Path, deformed: Path, options: SurfaceImportOptions) -> dict[str, str]:
    files = {"rest": rest, "deformed": deformed}
    if options.landmarks is not None:
        files["landmarks"] = options.landmarks
    for path in files.values():
        check_file(path)
    return {**{name: file_sha256(path) for name, path in files.items()}, "align": str(options.align)}


def _hash(inputs: dict[str, str]) -> str:
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def _earlier(path: Path, inputs: dict[str, str]) -> SurfacesRecord | None:
    """Summary of a finished import of the same surfaces; None where there is none. Raises InputError where the case is
    another's.
    """
    if not (path / "case.json").exists():
        return None
    case = CaseFolder(path)
    if case.step_is_done(IMPORT.name, _hash(inputs)):
        summary: SurfacesRecord = case.read_json(SUMMARY)
        return summary
    ours = case.has("import.json") and case.read_json("import.json").get("sources_sha256") == inputs
    if not ours and any(case.has(f"{state}{kind}") for state in STATES for kind in ("_ct", ".nii.gz")):
        raise InputError(f"{path} is the case of other scans or surfaces; choose a new folder for the case with -o")
    return None
