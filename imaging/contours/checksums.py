"""Checksums of compressed voxels: the libraries that read them stop where the voxels end, before what would tell of damage."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path
from typing import BinaryIO

from palpate.core.errors import InputError

_AT_ONCE = 2**22
_MAGIC = b"\x1f\x8b"


def check_gzip(stream: BinaryIO, path: Path) -> None:
    """Reads a gzip stream to its end. Raises InputError naming the file when its checksum or length is wrong."""
    try:
        with gzip.GzipFile(fileobj=stream, mode="rb") as content:
            while content.read(_AT_ONCE):
                pass
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path} is damaged (its gzip checksum or length is wrong); copy or save it again") from error


def check_gzip_file(path: Path) -> None:
    """As `check_gzip`, of a file that is compressed; others pass."""
    with path.open("rb") as stream:
        if stream.read(2) == _MAGIC:
            stream.seek(0)
            check_gzip(stream, path)
