"""The structures of a file with contours for a person to name: volume, and which organ the name stands for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from palpate.core.errors import InputError
from palpate.imaging.contours.label_reader import StructureEntry
from palpate.imaging.contours.readers import reader_of
from palpate.imaging.contours.roi_names import choose_rois

_PROSTATE = ("prostate", "prostate_left", "prostate_right")


def list_structures(path: Path) -> list[StructureEntry]:
    """The structures of a file that are not empty. Raises InputError naming the file when it cannot be read."""
    return reader_of(path).structures(path)


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
