"""Running the steps of a case from the command line."""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime

from palpate import __version__
from palpate.case.case_folder import CaseFolder
from palpate.ui.cli.typed import typed_options

HISTORY = "history.json"
_KEPT = 100


@contextmanager
def recorded(case: CaseFolder, args: argparse.Namespace) -> Iterator[None]:
    """Notes in the case, when the block has ended well, that this command ran on it: the report's provenance."""
    began = time.monotonic()
    yield
    record(case, args, time.monotonic() - began)


def record(case: CaseFolder, args: argparse.Namespace, seconds: float) -> None:
    """Adds a command to the case's history, as it would be typed again; paths are left out of it."""
    entry = {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": args.command,
        "options": typed_options(args, args._module),
        "version": __version__,
        "seconds": round(seconds, 1),
    }
    earlier = case.read_json(HISTORY).get("commands", []) if case.has(HISTORY) else []
    case.write_json(HISTORY, {"commands": [*earlier[-_KEPT + 1 :], entry]})
