"""Files and folders that appear whole or not at all, so that a kill at any moment leaves the last good state."""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from palpate.core.errors import InputError

# A temporary keeps the full name at its end, because nibabel and numpy choose the format by the suffix.
_LEFTOVER = re.compile(r"^\.(part|kept)-(\d+)-[0-9a-f]{8}-(.+)$")
# What this process is writing now: process ids come again (in containers soon), so the id alone does not tell.
_live: set[Path] = set()


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turns the operating system's refusal (read-only, full disk) into an InputError that names ``path``.

    Refusals that concern a file elsewhere, such as one being copied from, pass unchanged.
    """
    try:
        yield
    except OSError as error:
        if error.filename is not None and not _concerns(Path(str(error.filename)), path):
            raise
        reason = error.strerror or type(error).__name__
        raise InputError(
            f"{path} cannot be written ({reason}); choose another place, or allow writing there"
        ) from error


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path in the same folder, put in the place of ``path`` when the block ends without an exception.

    Raises InputError naming ``path`` where it cannot be written.
    """
    temporary = _beside(path, "part")
    with writing(path):
        _refuse_read_only(path.parent)
        path.parent.mkdir(parents=True, exist_ok=True)
        _live.add(temporary)
        try:
            yield temporary
            _flush(temporary)
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
            _live.discard(temporary)


@contextmanager
def atomic_folder(path: Path) -> Iterator[Path]:
    """A temporary folder that replaces the folder ``path`` when the block ends without an exception.

    A folder cannot be replaced in one step: the old one is kept under another name in between, and ``sweep`` puts
    it back after a kill at that moment. Raises InputError naming ``path`` where it cannot be written.
    """
    temporary, kept = _beside(path, "part"), _beside(path, "kept")
    with writing(path):
        _refuse_read_only(path.parent)
        temporary.mkdir(parents=True)
        _live.update((temporary, kept))
        try:
            yield temporary
            if path.exists():
                os.replace(path, kept)
            os.replace(temporary, path)
        finally:
            if kept.exists() and not path.exists():
                os.replace(kept, path)
            shutil.rmtree(temporary, ignore_errors=True)
            shutil.rmtree(kept, ignore_errors=True)
            _live.difference_update((temporary, kept))


def sweep(folder: Path) -> None:
    """Removes what killed runs left under ``folder``; leaves the temporaries of processes that still run, and a
    read-only folder as it is."""
    if is_read_only(folder):
        return
    for leftover in sorted(folder.rglob(".part-*")) + sorted(folder.rglob(".kept-*")):
        match = _LEFTOVER.match(leftover.name)
        if match is None or leftover in _live or _is_another_running(int(match[2])):
            continue
        whole = leftover.with_name(match[3])
        with writing(leftover):
            if match[1] == "kept" and not whole.exists():
                os.replace(leftover, whole)
            elif leftover.is_dir():
                shutil.rmtree(leftover, ignore_errors=True)
            else:
                leftover.unlink(missing_ok=True)


def is_read_only(folder: Path) -> bool:
    """Whether the nearest existing folder may not be written.

    Root may write where the mode says that nobody does; whoever marked a folder so meant it, and is obeyed.
    """
    standing = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    return not standing.stat().st_mode & 0o222 or not os.access(standing, os.W_OK | os.X_OK)


def _refuse_read_only(folder: Path) -> None:
    if is_read_only(folder):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))


def is_leftover(path: Path) -> bool:
    """Whether the name is one of a temporary."""
    return _LEFTOVER.match(path.name) is not None


def _concerns(named: Path, path: Path) -> bool:
    """Whether a refusal that names one path is about writing another: a file in its folder, or a folder above."""
    return named.is_relative_to(path.parent) or path.is_relative_to(named)


def _beside(path: Path, kind: str) -> Path:
    return path.with_name(f".{kind}-{os.getpid()}-{secrets.token_hex(4)}-{path.name}")


def _flush(path: Path) -> None:
    with path.open("rb") as stream:
        os.fsync(stream.fileno())


def _is_another_running(process_id: int) -> bool:
    if process_id == os.getpid():
        return False
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
