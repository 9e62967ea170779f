"""Running the steps of a case from the command line."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager

from palpate.case import history
from palpate.case.case_folder import CaseFolder
from palpate.ui.cli.typed import typed_options


def recorded(case: CaseFolder, args: argparse.Namespace) -> AbstractContextManager[None]:
    """Notes in the case, when the block has ended well, that this command ran on it: the report's provenance."""
    return history.recorded(case, args.command, typed_options(args, args._module))


def record(case: CaseFolder, args: argparse.Namespace, seconds: float) -> None:
    """Adds a command to the case's history, as it would be typed again; paths are left out of it."""
    history.add_entry(case, args.command, typed_options(args, args._module), seconds)
