"""Which steps of a case are out of date, as the steps themselves judge it: by the hashes of what they were made from.

A copied case is as done as the one it was copied from, whatever the times of its files. Hashing is done in a thread of its own;
a file that has kept size and time since is not read again.
"""

from __future__ import annotations

import queue
import re
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.core.errors import Cancelled, InputError
from palpate.ui.desktop.session.steps import BY_COMMAND
from palpate.ui.report.drawn_by import drawn_by

if TYPE_CHECKING:
    from palpate.ui.desktop.session.open_case import OpenCase

Hash = Callable[[Path], str]

# As in `mesh_step`, `identify_step`, `diagnose_step` and `report_step`, which load VTK; a test compares them.
MESH_INPUTS = ("rest.nii.gz", "deformed.nii.gz", "labels.txt")
IDENTIFY_INPUTS = ("mesh.npz", "surfaces.npz", "case.json", "landmarks.csv", "noise.json")
DIAGNOSE_INPUTS = ("mesh.npz", "surfaces.npz", "case.json", "landmarks.csv")
REPORT_INPUTS = (
    "case.json", "rest.nii.gz", "deformed.nii.gz", "rest_ct", "alignment.json", "segmentation.json", "mesh.json",
    "import.json", "result.json", "surfaces.npz", "identify/fields.npz", "identify/stiffness_map.npz", "diagnosis.json",
)  # fmt: skip
_MOST_MESHES = 10


class FileHashes:
    """Hashes of files, each read once for as long as its size and time stay the same. stop : set it to end the reading."""

    def __init__(self) -> None:
        self.stop = threading.Event()
        self._known: dict[Path, tuple[tuple[int, int], str]] = {}

    def __call__(self, path: Path) -> str:
        """SHA-256 in hex. Raises Cancelled when stopped, InputError for a file that cannot be read."""
        if self.stop.is_set():
            raise Cancelled("the case is closed")
        try:
            found = path.stat()
            mark = (found.st_size, found.st_mtime_ns)
            if self._known.get(path, (None, ""))[0] != mark:
                self._known[path] = (mark, file_sha256(path))
        except OSError as error:
            raise InputError(f"{path} cannot be read; look whether it is still there") from error
        return self._known[path][1]


def judged(case: CaseFolder, hash_of: Hash) -> Iterator[tuple[str, str]]:
    """(command, why it is out of date, or "") of every step that has run and can be out of date by its own inputs."""
    for command, judge in (("mesh", _mesh), ("identify", _identify), ("diagnose", _diagnose), ("report", _report)):
        if not case.has(BY_COMMAND[command].makes):
            continue
        try:
            reason = judge(case, hash_of)
            yield command, by_times(case.path, command) if reason is None else reason
        except InputError as error:
            yield command, " ".join(str(error).split())


def by_times(case: Path, command: str) -> str:
    """Why a step is out of date by the times of its files, for results that do not say what they were made from."""
    step = BY_COMMAND[command]
    made = case / step.makes
    newer = [
        n for n in step.made_from if (case / n).exists() and (case / n).stat().st_mtime_ns > made.stat().st_mtime_ns
    ]
    return f"{newer[0]} is newer" if newer else ""


def _mesh(case: CaseFolder, hash_of: Hash) -> str | None:
    noted, report = case.noted_inputs("mesh"), case.read_json("mesh.json")
    if noted is None or not isinstance(report, dict) or "options" not in report:
        return None
    now = case.inputs_sha256(MESH_INPUTS, report["options"], hash_of)
    return "" if now == noted else "the labels have been changed since"


class _MadeFrom(msgspec.Struct):
    """Of result.json, what it was made from; results made by hand need not say."""

    inputs_sha256: dict[str, str] = {}


def _identify(case: CaseFolder, hash_of: Hash) -> str | None:
    known = case.read("result.json", _MadeFrom).inputs_sha256
    if not known:
        return None
    # The labels act through the mesh and the surfaces, which hold what is used of them.
    names = sorted({*known, *IDENTIFY_INPUTS} - {"rest.nii.gz", "deformed.nii.gz"})
    now = {n: case.inputs_sha256([n], hash_of=hash_of) if case.has(n) else None for n in names}
    changed = [n for n in names if now[n] != known.get(n)]
    return f"{changed[0]} has been changed since" if changed else ""


def _diagnose(case: CaseFolder, hash_of: Hash) -> str | None:
    noted = case.noted_inputs("diagnose")
    if noted is None or case.facts.other.get("body"):
        return None
    said = " ".join(str(c.get("options", "")) for c in _commands(case) if c.get("command") in ("diagnose", "analyze"))
    seeds = {1, *map(int, re.findall(r"--seed (\d+)", said))}
    if "--effects" in said:
        return None  # where a person's own effects lay is not written down
    asked = [{"seed": s, "effects": {}, "meshes": m} for s in sorted(seeds) for m in range(1, _MOST_MESHES + 1)]
    made = any(case.inputs_sha256(DIAGNOSE_INPUTS, options, hash_of) == noted for options in asked)
    return "" if made else "its input or the version has been changed since"


def _report(case: CaseFolder, hash_of: Hash) -> str | None:
    noted = case.noted_inputs("report")
    if noted is None:
        return None
    program = drawn_by()
    made = any(case.inputs_sha256(REPORT_INPUTS, [{"pdf": pdf}, program], hash_of) == noted for pdf in (True, False))
    return "" if made else "what it shows or the program has been changed since"


def _commands(case: CaseFolder) -> list[dict[str, object]]:
    history = case.read_json("history.json") if case.has("history.json") else {}
    found = history.get("commands", []) if isinstance(history, dict) else []
    return [entry for entry in found if isinstance(entry, dict)]


class Freshness:
    """reasons : command -> why it is out of date, "" where it is not, as far as it is known yet. Lives in the window's thread."""

    def __init__(self) -> None:
        self.reasons: dict[str, str] = {}
        self._hashes = FileHashes()
        self._thread = ThreadPoolExecutor(1, "palpate-freshness")
        self._found: queue.Queue[tuple[int, str, str]] = queue.Queue()
        self._number, self._ended = 0, 0

    @property
    def running(self) -> bool:
        """Whether not all is known yet."""
        return self._ended < self._number

    def start(self, case: OpenCase) -> None:
        """Judges a case anew, once all that the window has to write is written."""
        self._number += 1
        self.reasons = {}
        self._thread.submit(self._judge, self._number, case)

    def forget(self) -> None:
        """Leaves the case. Waits for the file that is being read, and no longer."""
        self._hashes.stop.set()
        self._thread.submit(lambda: None).result()
        self._hashes.stop.clear()
        self._number += 1  # what is still in the queue belongs to nobody
        self._ended, self.reasons = self._number, {}

    def close(self) -> None:
        """Ends the thread."""
        self._hashes.stop.set()
        self._thread.shutdown(wait=True)

    def poll(self) -> bool:
        """Takes in what is known by now. True when there was something new."""
        heard = False
        while not self._found.empty():
            number, command, reason = self._found.get()
            if number == self._number:
                heard = True
                if command:
                    self.reasons[command] = reason
                else:
                    self._ended = number
        return heard

    def _judge(self, number: int, case: OpenCase) -> None:
        try:
            if number == self._number and not self._hashes.stop.is_set():
                case.flush()
                for command, reason in judged(case.folder, self._hashes):
                    self._found.put((number, command, reason))
        except Cancelled:
            return
        finally:
            self._found.put((number, "", ""))
