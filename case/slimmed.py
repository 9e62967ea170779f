"""A finished case without what is only needed to compute again (slimmed.json), so that it can come with the program.

Files that are shown and hashed keep their names and lose arrays. A slimmed file counts as the whole one it was made from: results are not
out of date because of it. What computes from it makes it whole first (`case.steps.whole`).
"""

from __future__ import annotations

import msgspec
import numpy as np

from palpate.case.case_files import CaseFiles, file_sha256
from palpate.core.errors import InputError

FILE = "slimmed.json"
# File -> end or beginning of the names of its arrays that nothing shows.
ARRAYS = {"surfaces.npz": "_voxel_errors", "matched_motion.npz": "scores/", "diagnose/gap_maps.npz": "predicted/"}


class SlimFile(msgspec.Struct):
    """SHA-256 of a file as it is here, and as it was."""

    here: str
    whole: str


class Slimmed(msgspec.Struct):
    """slimmed.json. files : slimmed ones by name. left_out : names of files. scans : slice in the case -> slice in the sample's folder."""

    files: dict[str, SlimFile]
    left_out: list[str]
    scans: dict[str, str]


def slim(case: CaseFiles, name: str) -> SlimFile:
    """Drops the arrays of a file that nothing shows."""
    whole, dropped = file_sha256(case.file(name)), ARRAYS[name]
    kept = {k: a for k, a in case.read_npz(name).items() if not (k.endswith(dropped) or k.startswith(dropped))}
    with case.atomic_path(name) as path:
        np.savez(path, **kept)  # type: ignore[arg-type]  # the archive compresses it better
    return SlimFile(file_sha256(case.file(name)), whole)


def whole_sha256(case: CaseFiles, name: str, found: str) -> str:
    """The hash that a file counts by. found : its own. Raises InputError where slimmed.json is damaged."""
    if name not in ARRAYS or not case.has(FILE):
        return found
    noted = case.read(FILE, Slimmed).files.get(name)
    return noted.whole if noted is not None and noted.here == found else found


def slim_files(case: CaseFiles) -> list[str]:
    """Names of the files that are not whole."""
    if not case.has(FILE):
        return []
    noted = case.read(FILE, Slimmed).files
    return [name for name, one in noted.items() if case.has(name) and file_sha256(case.file(name)) == one.here]


def require_whole(case: CaseFiles, name: str) -> None:
    """Raises InputError where a file holds only what is shown."""
    if name in slim_files(case):
        raise InputError(f"{case.file(name)} holds only what is shown of the finished sample; run `palpate mesh` first")
