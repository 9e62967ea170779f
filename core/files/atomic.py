"""Files and folders that are written whole or not at all, so that a kill at any moment leaves the last good state."""

from __future__ import annotations

import errno
import os
import re
import secrets
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from palpate.core.errors import InputError

# A temporary keeps the full name at its end, because nibabel and numpy choose the format by the suffix.
_LEFTOVER = re.compile(r"^\.(part|kept)-(\d+)-[0-9a-f]{8}-(.+)$")
# Temporaries of this process. The process id alone does not identify them: ids are reused, in containers soon.
_live: set[Path] = set()


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an OSError of writing `path` (read-only, full disk) into an InputError that names it.

    Errors of other files, such as one being copied from, pass unchanged.
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
    """Temporary path in the same folder; it replaces `path` when the block ends without an exception.

    Raises InputError naming `path` where it cannot be written.
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
    """Temporary folder; it replaces the folder `path` when the block ends without an exception.

    A folder cannot be replaced in one step: the old one is kept under another name in between, and `sweep` restores it
    after a kill at that moment. Raises InputError naming `path` where it cannot be written.
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
    """Remove the temporaries of killed runs under `folder`, but not those of running processes; a read-only folder
    stays as it is.
    """
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
    """Whether the nearest existing folder is read-only, for root also by its mode alone."""
    standing = next(parent for parent in (folder, *folder.absolute().parents) if parent.exists())
    return not standing.stat().st_mode & 0o222 or not os.access(standing, os.W_OK | os.X_OK)


def _refuse_read_only(folder: Path) -> None:
    if is_read_only(folder):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))


def is_leftover(path: Path) -> bool:
    """Whether the path is that of a temporary."""
    return _LEFTOVER.match(path.name) is not None


def _concerns(named: Path, path: Path) -> bool:
    """Whether an error that names `named` concerns the writing of `path`: a file in its folder, or a folder above."""
    return named.is_relative_to(path.parent) or path.is_relative_to(named)


def _beside(path: Path, kind: str) -> Path:
    return path.with_name(f".{kind}-{os.getpid()}-{secrets.token_hex(4)}-{path.name}")


def _flush(path: Path) -> None:
    with path.open("rb+") as stream:  # Windows flushes only what may be written
        os.fsync(stream.fileno())


def _is_another_running(process_id: int) -> bool:
    if process_id == os.getpid():
        return False
    if sys.platform == "win32":  # there, signal 0 is Ctrl-C
        return True
    try:
        os.kill(process_id, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True
