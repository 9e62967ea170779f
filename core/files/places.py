"""Places that nothing can be written to, or must not be."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from palpate.core.errors import InputError


def check_utf8(path: Path, remedy: str) -> None:
    """Raises InputError, with the remedy, where the whole path is not UTF-8: Python reads and writes it, libraries in C++ end the
    program."""
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError as error:
        shown = str(path).encode("ascii", "backslashreplace").decode()
        raise InputError(f"{shown} is a name that is not UTF-8; {remedy}") from error


def check_outside(folder: Path, scans: Iterable[Path]) -> None:
    """Raises InputError where a folder that is to be written lies within the folder of a scan, or is one."""
    for scan in scans:
        if scan.is_dir() and folder.resolve().is_relative_to(scan.resolve()):
            raise InputError(f"{folder} lies inside the scan {scan}, whose slices it would join; choose another place")
