"""The files of a case folder, written whole or not at all, and read with one clear line where they are damaged."""

from __future__ import annotations

import hashlib
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from palpate.core.arrays import NumberArray
from palpate.core.errors import InputError
from palpate.core.files import atomic, json_file
from palpate.core.files.damaged_archive import DAMAGED_ARCHIVE
from palpate.core.files.json_file import as_json

T = TypeVar("T")


def require_case(path: Path) -> None:
    """Raises InputError where a path is no case folder."""
    remedy = "give the path of a case folder, or make one with `palpate import`"
    if not path.is_dir():
        raise InputError(f"{path} is no folder; {remedy}")
    if not (path / "case.json").exists():
        raise InputError(f"{path} has no case.json; {remedy}")


class CaseFiles:
    """A folder. All writing is atomic and raises InputError naming the file where the folder is read-only or the disk
    full.

    path : the folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def file(self, name: str) -> Path:
        """The path of a file or folder of the case."""
        return self.path / name

    def has(self, name: str) -> bool:
        """Whether the case holds this file or folder."""
        return self.file(name).exists()

    def atomic_path(self, name: str) -> AbstractContextManager[Path]:
        """A temporary path that becomes the file ``name`` when the ``with`` block ends well."""
        return atomic.atomic_path(self.file(name))

    def atomic_folder(self, name: str) -> AbstractContextManager[Path]:
        """A temporary folder that becomes the folder ``name`` when the ``with`` block ends well."""
        return atomic.atomic_folder(self.file(name))

    def write_bytes(self, name: str, data: bytes) -> Path:
        """Writes a file."""
        with self.atomic_path(name) as temporary:
            temporary.write_bytes(data)
        return self.file(name)

    def write_text(self, name: str, text: str) -> Path:
        """Writes a text file in UTF-8."""
        return self.write_bytes(name, text.encode())

    def write_json(self, name: str, data: object) -> Path:
        """Writes a JSON file (`as_json`). Raises ValueError for NaN and infinity."""
        return self.write_text(name, as_json(data))

    def write_npz(self, name: str, **arrays: NumberArray) -> Path:
        """Writes a compressed NumPy archive."""
        with self.atomic_path(name) as temporary:
            np.savez_compressed(temporary, **arrays)  # type: ignore[arg-type]
        return self.file(name)

    def remove(self, name: str) -> None:
        """Removes a file where it is there."""
        with atomic.writing(self.file(name)):
            self.file(name).unlink(missing_ok=True)

    def read_json(self, name: str) -> Any:
        """The content of a JSON file. Raises InputError naming the file and the line when it is not JSON."""
        return json_file.read_json(self.file(name))

    def read(self, name: str, kind: type[T], remedy: str = "; run the step that writes it again") -> T:
        """The content of a JSON file as a declared type. Raises InputError naming the file and what is wrong in it."""
        return json_file.read_typed(self.file(name), kind, remedy)

    def read_npz(self, name: str) -> dict[str, np.ndarray]:
        """The arrays of a NumPy archive. Raises InputError naming the file when it is missing or damaged."""
        path = self.file(name)
        try:
            with np.load(path, allow_pickle=False) as archive:
                return {key: archive[key] for key in archive.files}
        except FileNotFoundError as error:
            raise InputError(f"{path} is not there; run the step that writes it first") from error
        except DAMAGED_ARCHIVE as error:
            raise InputError(f"{path} is damaged; remove it and run the step that writes it again") from error


def file_sha256(path: Path) -> str:
    """The SHA-256 of a file's content, in hex."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
