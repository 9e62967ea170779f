"""The commands that ran on a case, history.json: the report's provenance. No path is in it, because a folder's name may be a patient's."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from typing import TypedDict

from palpate import __version__
from palpate.case.case_folder import CaseFolder


class Entry(TypedDict, total=False):
    """A command that ran, with its options as they would be typed again. seconds : it took. Older files have fewer of these."""

    date: str
    command: str
    options: str
    version: str
    seconds: float


FILE = "history.json"
# Commands that are kept, the last ones.
_KEPT = 100


@contextmanager
def recorded(case: CaseFolder, command: str, options: str) -> Iterator[None]:
    """Notes, when the block has ended well, that this command ran on the case."""
    began = time.monotonic()
    yield
    add_entry(case, command, options, time.monotonic() - began)


def add_entry(case: CaseFolder, command: str, options: str, seconds: float) -> None:
    """Adds a command. options : as they would be typed again, without paths."""
    entry: Entry = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": command,
        "options": options,
        "version": __version__,
        "seconds": round(seconds, 1),
    }
    earlier = case.read_json(FILE).get("commands", []) if case.has(FILE) else []
    case.write_json(FILE, {"commands": [*earlier[-_KEPT + 1 :], entry]})
