"""DICOM structure sets."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.imaging.contours.label_reader import LabelReader, Roi, StructureEntry, UserLabels
from palpate.imaging.contours.rtstruct import opened_rtstruct, read_rtstruct, structures_in
from palpate.imaging.contours.structure_names import organ_of
from palpate.imaging.dicom.files import reading
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_SOURCE = "rtstruct"
_CUBIC_MM = 1000.0


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    found = read_rtstruct(path, ct, facts, roi)
    return UserLabels(found.labels(ct), _SOURCE, found.prostate_is_split, found.names, found.notes)


def _structures(path: Path) -> list[StructureEntry]:
    dataset = opened_rtstruct(path)
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


READER = LabelReader(_SOURCE, "DICOM RTSTRUCT", _read, _structures, modality="RTSTRUCT")
