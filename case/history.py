"""Commands that ran on a case (history.json), the provenance in the report.

The file holds no path, because a folder's name may be a patient's.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import TypedDict

from palpate import __version__
from palpate.case.case_folder import CaseFolder


class Entry(TypedDict, total=False):
    """One command. date : UTC. options : as typed, without paths. seconds : run time. Older files lack some keys."""

    date: str
    command: str
    options: str
    version: str
    seconds: float


FILE = "history.json"
# Number of commands that are kept; the oldest are dropped.
_KEPT = 100


@contextmanager
def recorded(case: CaseFolder, command: str, options: str) -> Iterator[None]:
    """Context that adds this command to history.json when its block ends without an error.

    Raises InputError before the block starts where the case cannot be written: some steps write after minutes only.
    """
    if case.path.exists():
        case.check_writable()
    began = time.monotonic()
    yield
    add_entry(case, command, options, time.monotonic() - began)


def add_entry(case: CaseFolder, command: str, options: str, seconds: float) -> None:
    """Append a command to history.json. options : as typed, without paths. seconds : run time.

    Raises InputError when the existing file is damaged.
    """
    entry: Entry = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": command,
        "options": options,
        "version": __version__,
        "seconds": round(seconds, 1),
    }
    earlier = case.read_json(FILE).get("commands", []) if case.has(FILE) else []
    case.write_json(FILE, {"commands": [*earlier[-_KEPT + 1 :], entry]})
