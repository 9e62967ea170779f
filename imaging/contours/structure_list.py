"""The structures of a file with contours for a person to name: volume, and which organ the name stands for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.contours.dicom_seg import read_dicom_seg
from palpate.imaging.contours.itksnap_labels import read_label_names
from palpate.imaging.contours.itksnap_workspace import LABEL_LAYER, read_workspace
from palpate.imaging.contours.named_labels import Segments
from palpate.imaging.contours.nifti_labels import names_within, read_numbers
from palpate.imaging.contours.roi_names import choose_rois
from palpate.imaging.contours.rtstruct import structures_in
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd
from palpate.imaging.contours.structure_names import organ_of
from palpate.imaging.contours.user_labels import DESCRIPTION, is_segmentation
from palpate.imaging.dicom.files import read_file, reading
from palpate.imaging.labels import LABELS

_NIFTI = (".nii", ".nii.gz")
_CUBIC_MM = 1000.0
_PROSTATE = ("prostate", "prostate_left", "prostate_right")


@dataclass(frozen=True)
class StructureEntry:
    """One structure. identifier : as `--roi` takes it. organ : that its name stands for; "" for none that is known."""

    identifier: str
    name: str
    volume_cc: float
    organ: str


def list_structures(path: Path) -> list[StructureEntry]:
    """The structures of a file that are not empty. Raises InputError naming the file when it cannot be read."""
    name = path.name.lower()
    if name.endswith((*_NIFTI, ".itksnap")):
        return _of_numbers(path)
    if name.endswith(".nrrd"):
        return _of_segments(read_seg_nrrd(path))
    if is_segmentation(path):
        return _of_segments(read_dicom_seg(path))
    return _of_rtstruct(path)


def is_clear(entries: Sequence[StructureEntry], path: Path) -> bool:
    """Whether the names alone say which structures are which organs, the prostate among them."""
    if not any(entry.organ in _PROSTATE for entry in entries):
        return False
    if any(entry.identifier != entry.name for entry in entries):
        return True  # numbers that each mean one label
    try:
        choose_rois([entry.name for entry in entries], str(path))
    except InputError:
        return False
    return True


def _of_numbers(path: Path) -> list[StructureEntry]:
    names: Mapping[int, str]
    if path.name.lower().endswith(".itksnap"):
        workspace = read_workspace(path)
        path, names = workspace.only(LABEL_LAYER, str(path)).path, workspace.names
    else:
        description = path.parent / DESCRIPTION
        names = read_label_names(description) if description.is_file() else names_within(path)
    volume = read_numbers(path)
    values, counts = np.unique(volume.array[volume.array > 0], return_counts=True)
    voxel = float(np.prod(volume.spacing)) / _CUBIC_MM
    out = []
    for value, count in zip(values.tolist(), counts.tolist(), strict=True):
        name = names.get(value, "").strip()
        organ = organ_of(name) if name else LABELS.get(value)
        out.append(StructureEntry(str(value), name or f"label {value}", count * voxel, organ or ""))
    return out


def _of_segments(segments: Segments) -> list[StructureEntry]:
    voxel = float(np.prod(segments.grid.spacing)) / _CUBIC_MM
    counts = {name: int(segments.mask(name).sum()) for name in segments.names}
    return [StructureEntry(name, name, n * voxel, organ_of(name) or "") for name, n in counts.items() if n]


def _of_rtstruct(path: Path) -> list[StructureEntry]:
    dataset = read_file(path) if path.is_file() else None
    if dataset is None or dataset.get("Modality") != "RTSTRUCT":
        raise InputError(
            f"{path} holds no contours: give an RTSTRUCT, DICOM SEG, NIfTI, ITK-SNAP workspace or .seg.nrrd"
        )
    with reading(path):
        rois = structures_in(dataset, path, [])
    return [
        StructureEntry(name, name, _volume_cc(roi.contours), organ_of(name) or "")
        for name, roi in rois.items()
        if roi.contours
    ]


def _volume_cc(contours: Sequence[FloatArray]) -> float:
    """Sum of the contours' areas times the distance of their slices: an estimate without the CT; holes count as full."""
    normals = [_area_vector(points) for points in contours]
    largest = max(normals, key=lambda normal: float(np.linalg.norm(normal)))
    length = float(np.linalg.norm(largest))
    if length == 0.0:
        return 0.0
    heights = np.unique(np.round([points.mean(axis=0) @ largest / length for points in contours], 2))
    step = float(np.median(np.diff(heights))) if len(heights) > 1 else 0.0
    return float(sum(np.linalg.norm(normal) for normal in normals)) * step / _CUBIC_MM


def _area_vector(points: FloatArray) -> FloatArray:
    """Normal of a closed contour (n, 3), as long as its area, mm2."""
    away = points - points[0]
    return np.asarray(0.5 * np.cross(away, np.roll(away, -1, axis=0)).sum(axis=0), dtype=np.float64)
