"""Running the steps of a case from the command line."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from palpate.ui.cli.typed import typed_options

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder


def recorded(case: CaseFolder, args: argparse.Namespace) -> AbstractContextManager[None]:
    """Notes in the case, when the block has ended well, that this command ran on it: the report's provenance."""
    from palpate.case import history  # here, because it takes seconds to load

    return history.recorded(case, args.command, typed_options(args, args._module))


def record(case: CaseFolder, args: argparse.Namespace, seconds: float) -> None:
    """Adds a command to the case's history, as it would be typed again; paths are left out of it."""
    from palpate.case import history

    history.add_entry(case, args.command, typed_options(args, args._module), seconds)
