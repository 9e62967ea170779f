"""Which steps of a case are out of date, as the steps themselves judge it: by the hashes of what they were made from.

A copied case is as done as the one it was copied from, whatever the times of its files. Hashing is done in a thread of
its own; a file that has kept size and time since is not read again.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.case.case_folder import CaseFolder, file_sha256
from palpate.case.steps.step import Hash, Step
from palpate.core.errors import Cancelled, InputError
from palpate.ui.desktop.session.steps import FIRST, STEPS

if TYPE_CHECKING:
    from palpate.ui.desktop.session.open_case import OpenCase


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
    for button in STEPS:
        step = button.declared
        if button.command in FIRST or not case.has(step.result):
            continue
        try:
            reason = step.out_of_date(case, hash_of)
            yield step.name, by_times(case, step) if reason is None else reason
        except InputError as error:
            yield step.name, " ".join(str(error).split())


def by_times(case: CaseFolder, step: Step) -> str:
    """Why a step is out of date by the times of its files, for results that do not say what they were made from."""
    made = case.file(step.result).stat().st_mtime_ns
    newer = [n for n in step.inputs(case) if case.has(n) and case.file(n).stat().st_mtime_ns > made]
    return f"{newer[0]} is newer" if newer else ""


class OutOfDateCheck:
    """Check of the steps of an open case in a thread of its own; called from the window's thread.

    reasons : command -> why it is out of date, "" where it is not; commands not yet checked are absent.
    """

    def __init__(self) -> None:
        self.reasons: dict[str, str] = {}
        self._hashes = FileHashes()
        self._thread = ThreadPoolExecutor(1, "palpate-out-of-date")
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
