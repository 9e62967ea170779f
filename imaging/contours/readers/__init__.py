"""Readers of labels, one a file: each module of this folder defines a READER and is found by itself."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from pathlib import Path

from palpate.core.errors import InputError
from palpate.imaging.contours.label_reader import LabelReader
from palpate.imaging.dicom.files import read_file


@cache
def readers() -> dict[str, LabelReader]:
    """The readers there are, by source."""
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    found: list[LabelReader] = [importlib.import_module(f"{__name__}.{name}").READER for name in names]
    return {reader.source: reader for reader in found}


def reader_by_suffix(path: Path) -> LabelReader | None:
    """The reader of the longest ending that the file's name has; None where no reader's."""
    name = path.name.lower()
    ending = max((s for r in readers().values() for s in r.suffixes if name.endswith(s)), key=len, default=None)
    return next((reader for reader in readers().values() if ending in reader.suffixes), None)


def reader_of(path: Path) -> LabelReader:
    """The reader of a file, by its ending or its DICOM modality. Raises InputError where there is none, or no file."""
    reader = reader_by_suffix(path)
    if reader is not None:
        return reader
    if not path.is_file():
        raise InputError(f"{path} is not there; give the path of a file with contours ({words()})")
    header = read_file(path, stop_before_pixels=True)
    modality = "" if header is None else str(header.get("Modality") or "")
    for reader in readers().values():
        if modality and reader.modality == modality:
            return reader
    raise InputError(f"{path} holds no contours: give {words()}")


def words() -> str:
    """The forms that are read, for a message."""
    return ", ".join(reader.words for reader in readers().values())
