"""Where the palpate program is, and the environment it needs. Slicer's own Python cannot run it and does not have to."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

_WINDOWS = os.name == "nt"
# The repository's entry: Windows cannot run the shell script that lies beside it.
ENTRY = "run.cmd" if _WINDOWS else "run"
INSTALL = (
    f"The palpate program was not found. Clone its repository and give the path of its file `{ENTRY}` in the field Program, "
    "or put `palpate` on the PATH."
)
# What Slicer sets for its own Python and libraries, which another Python must not get.
_OWN = ("PYTHONHOME", "PYTHONPATH", "PYTHONNOUSERSITE", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "QT_PLUGIN_PATH")


class ProgramNotFoundError(Exception):
    """There is no palpate program where it was looked for."""


def program_command(given: str = "") -> list[str]:
    """The beginning of every command line. ``given`` : path of the program or of the repository's ENTRY; may be empty.

    Looked for in this order: ``given``, the variable PALPATE, ENTRY of the repository that this extension lies in, the
    environment that the module installed (`install.py`), PATH.
    Raises ProgramNotFoundError saying what to do.
    """
    for text in (given.strip(), os.environ.get("PALPATE", "").strip()):
        if text:
            return _command_of(Path(text).expanduser())
    beside = Path(__file__).resolve().parents[3] / ENTRY
    if beside.is_file() and os.access(beside, os.X_OK):
        return _command_of(beside)
    own = Path.home() / ".palpate" / "environment" / ("Scripts/palpate.exe" if _WINDOWS else "bin/palpate")
    if own.is_file():
        return [str(own)]
    found = shutil.which("palpate")
    if found is None:
        raise ProgramNotFoundError(INSTALL)
    return [found]


def environment() -> dict[str, str]:
    """The environment of the user's session, without what Slicer added to it."""
    try:
        from slicer.util import startupEnvironment
    except ImportError:
        return {key: value for key, value in os.environ.items() if key not in _OWN}
    try:
        found = dict(startupEnvironment())
    except AttributeError:  # no application: the libraries alone, as in tests
        found = dict(os.environ)
    return {key: value for key, value in found.items() if key not in _OWN}


def _command_of(path: Path) -> list[str]:
    if path.is_dir() and (path / ENTRY).is_file():
        path = path / ENTRY
    if _WINDOWS and path.name == "run" and path.with_name(ENTRY).is_file():
        path = path.with_name(ENTRY)
    if not path.is_file() or not os.access(path, os.X_OK):
        raise ProgramNotFoundError(f"{path} is no program that can be run. {INSTALL}")
    return [str(path), "palpate"] if path.name == ENTRY else [str(path)]
