"""Running the steps of a case from the command line."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from importlib import metadata

from palpate.segmentation.case import CaseFolder
from palpate.ui.cli.arguments import written_options

HISTORY = "history.json"
_KEPT = 100


@contextmanager
def recorded(case: CaseFolder, args: argparse.Namespace) -> Iterator[None]:
    """Notes in the case, when the block has ended well, that this command ran on it: the report's provenance."""
    began = time.monotonic()
    yield
    record(case, args, time.monotonic() - began)


def record(case: CaseFolder, args: argparse.Namespace, seconds: float) -> None:
    """Adds a command to the case's history. Paths are left out of it, because a folder's name may be a patient's."""
    entry = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": args.command,
        "options": written_options(args, ("json", "quiet", "workers", "command")),
        "version": metadata.version("palpate"),
        "seconds": round(seconds, 1),
    }
    earlier = case.read_json(HISTORY).get("commands", []) if case.has(HISTORY) else []
    case.write_json(HISTORY, {"commands": [*earlier[-_KEPT + 1 :], entry]})
