"""NRRD label volumes; a segmentation of 3D Slicer that was saved under this ending stays one."""

from __future__ import annotations

from pathlib import Path

from palpate.imaging.contours.label_reader import LabelReader, Roi, StructureEntry, UserLabels
from palpate.imaging.contours.numbered_volume import read_volume, structures_of, with_description
from palpate.imaging.contours.readers.seg_nrrd import READER as SEGMENTATION
from palpate.imaging.contours.seg_nrrd import names_segments
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_SOURCE = "nrrd"


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    return SEGMENTATION.read(path, ct, facts, roi) if names_segments(path) else read_volume(path, _SOURCE, roi)


def _structures(path: Path) -> list[StructureEntry]:
    return SEGMENTATION.structures(path) if names_segments(path) else structures_of(path)


def _files(path: Path) -> list[Path]:
    return [path] if names_segments(path) else with_description(path)


READER = LabelReader(_SOURCE, "NRRD", _read, _structures, (".nrrd",), holds_voxels=True, files=_files)
