"""Segmentations of 3D Slicer."""

from __future__ import annotations

from pathlib import Path

from palpate.imaging.contours.label_reader import LabelReader, Roi, UserLabels
from palpate.imaging.contours.named_labels import segments_as_labels, segments_as_structures
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_SOURCE = "seg.nrrd"


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    return segments_as_labels(read_seg_nrrd(path), _SOURCE, path, roi)


READER = LabelReader(
    _SOURCE,
    ".seg.nrrd",
    _read,
    lambda path: segments_as_structures(read_seg_nrrd(path)),
    (".seg.nrrd",),
    holds_voxels=True,
)
