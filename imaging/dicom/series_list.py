"""The series of a folder for a person to choose from: date, slices, thickness, and a small picture of the middle slice."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import NumberArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.files import DicomFile, find_dicom
from palpate.imaging.dicom.pixels import read_slices
from palpate.imaging.dicom.series_choice import description_of, image_series, printable
from palpate.imaging.dicom.slices import Slice, is_localizer, slices_of

_PICTURE_PIXELS = 128


@dataclass(frozen=True, eq=False)
class SeriesEntry:
    """One series. identifier : for `read_series`. date : YYYY-MM-DD, "" where it has none. size : columns and rows.

    thickness_mm : distance of its slices, None for a single one. description : the operator's words without the
    patient's name. picture : HU of the middle slice, at most 128 pixels a side; None where it cannot be read.
    """

    identifier: str
    date: str
    slices: int
    size: tuple[int, int]
    thickness_mm: float | None
    description: str
    picture: NumberArray | None


def list_series(folder: Path, modalities: Sequence[str] = ("CT",)) -> list[SeriesEntry]:
    """The image series under a folder in the order of `choose_series`. Raises InputError as `find_dicom`."""
    groups, _ = image_series(find_dicom(folder, []), modalities)
    return [_entry(str(number), groups[key]) for number, key in enumerate(sorted(groups), start=1)]


def _entry(identifier: str, files: Sequence[DicomFile]) -> SeriesEntry:
    header = files[0].header
    slices = [one for file in files if not is_localizer(file.header) for one in slices_of(file)]
    slices.sort(key=_height)
    date = printable(header.get("SeriesDate") or header.get("AcquisitionDate") or header.get("StudyDate") or "")
    words = f"{date[:4]}-{date[4:6]}-{date[6:8]}" if len(date) == 8 and date.isdigit() else ""
    rows, columns = slices[0].shape if slices else (0, 0)
    return SeriesEntry(
        identifier,
        words,
        len(slices),
        (columns, rows),
        _thickness(slices),
        description_of(header).strip("'\""),
        _picture(slices),
    )


def _height(one: Slice) -> float:
    """Along the slices' normal, mm."""
    return float(np.cross(one.right, one.down) @ one.origin)


def _thickness(slices: Sequence[Slice]) -> float | None:
    if len(slices) < 2:
        return None
    return round(float(np.median(np.diff([_height(one) for one in slices]))), 2)


def _picture(slices: Sequence[Slice]) -> NumberArray | None:
    if not slices:
        return None
    try:
        middle = read_slices([slices[len(slices) // 2]])[0]
    except InputError:  # a choice is possible without it
        return None
    step = int(np.ceil(max(middle.shape) / _PICTURE_PIXELS))
    return middle[::step, ::step]
