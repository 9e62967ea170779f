"""Paths whose bytes are no UTF-8: Python reads and writes them, the libraries in C++ end the program."""

from __future__ import annotations

from pathlib import Path

from palpate.core.errors import InputError


def check_utf8(path: Path, remedy: str) -> None:
    """Raises InputError, with the remedy, where the whole path is not UTF-8."""
    try:
        str(path.absolute()).encode()
    except UnicodeEncodeError as error:
        shown = str(path).encode("ascii", "backslashreplace").decode()
        raise InputError(f"{shown} is a name that is not UTF-8; {remedy}") from error
