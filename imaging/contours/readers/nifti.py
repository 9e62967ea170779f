"""NIfTI label volumes."""

from __future__ import annotations

from pathlib import Path

from palpate.imaging.contours.label_reader import LabelReader, Roi, UserLabels
from palpate.imaging.contours.nifti_labels import NIFTI
from palpate.imaging.contours.numbered_volume import read_volume, structures_of, with_description
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_SOURCE = "nifti"


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    return read_volume(path, _SOURCE, roi)


READER = LabelReader(_SOURCE, "NIfTI", _read, structures_of, NIFTI, holds_voxels=True, files=with_description)
