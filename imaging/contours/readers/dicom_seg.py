"""DICOM segmentations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from palpate.imaging.contours.dicom_seg import images_of, read_dicom_seg
from palpate.imaging.contours.label_reader import LabelReader, Roi, UserLabels
from palpate.imaging.contours.named_labels import segments_as_labels, segments_as_structures
from palpate.imaging.dicom.files import reading
from palpate.imaging.dicom.same_scan import check_same_scan
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_SOURCE = "dicom-seg"


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    segments = read_dicom_seg(path)
    unchecked: list[str] = []
    if facts is not None:
        with reading(path):
            unchecked = check_same_scan(segments.origin, images_of(segments.origin), facts, path)
    labels = segments_as_labels(segments, _SOURCE, path, roi)
    return replace(labels, notes=(*unchecked, *labels.notes))


READER = LabelReader(
    _SOURCE, "DICOM SEG", _read, lambda path: segments_as_structures(read_dicom_seg(path)), modality="SEG"
)
