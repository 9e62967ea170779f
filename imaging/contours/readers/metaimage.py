"""MetaImage label volumes (.mha, .mhd)."""

from __future__ import annotations

from pathlib import Path

from palpate.imaging.contours.label_reader import LabelReader, Roi, UserLabels
from palpate.imaging.contours.metaimage import METAIMAGE, voxel_files
from palpate.imaging.contours.numbered_volume import read_volume, structures_of, with_description
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.volume import Volume

_SOURCE = "metaimage"


def _read(path: Path, ct: Volume, facts: SeriesFacts | None, roi: Roi) -> UserLabels:
    return read_volume(path, _SOURCE, roi)


def _files(path: Path) -> list[Path]:
    return [*voxel_files(path), *with_description(path)[1:]]


READER = LabelReader(_SOURCE, "MetaImage", _read, structures_of, METAIMAGE, holds_voxels=True, files=_files)
