"""One scan, in whatever form it comes."""

from __future__ import annotations

from pathlib import Path

from palpate.core.errors import InputError
from palpate.imaging.dicom.files import list_files
from palpate.imaging.dicom.series import SeriesFacts, read_series
from palpate.imaging.scans.volume_file import (
    WORDS,
    files_of_volume,
    holds_labels,
    is_volume_file,
    read_volume_file,
)
from palpate.imaging.volume import Volume

# The one file in the folder of a scan that a case keeps and that was no DICOM.
KEPT = "ct.nrrd"


def read_scan(path: Path | str, series: str | None = None) -> tuple[Volume, SeriesFacts]:
    """The volume (HU) and the facts of a CT: a DICOM folder, a volume file, or the folder that a case keeps of one.

    series : as `read_series`. Raises InputError, one line that names the file or folder and the remedy.
    """
    path = Path(path)
    file = path / KEPT if is_kept_volume(path) else path
    if is_volume_file(file):
        if series is not None and file.is_file():
            raise InputError(f"{file} is one volume and holds no series: leave --series out")
        return read_volume_file(file)
    return read_series(path, series)


def is_kept_volume(folder: Path) -> bool:
    """Whether a case's folder of a scan holds a volume that was no DICOM."""
    return (folder / KEPT).is_file()


def is_ct(path: Path) -> bool:
    """Whether a path that exists stands for a CT, not for a label volume. Raises InputError where it is neither, or unreadable."""
    if path.is_dir():
        return True
    if not is_volume_file(path):
        raise InputError(f"{path} is no scan; give a folder with a DICOM CT series, a CT or a label volume as {WORDS}")
    return not holds_labels(path)


def files_of_scan(path: Path) -> list[Path]:
    """The files that are read of a scan. Raises InputError where there are none."""
    return list_files(path) if path.is_dir() else files_of_volume(path)
