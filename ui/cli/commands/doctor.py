"""Says what works on this machine: Python, packages, solver, off-screen rendering, disk, cores, memory.

Ends with 0 when everything that is needed is there, 3 when something is not.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from typing import TYPE_CHECKING

from palpate.core.errors import InputError
from palpate.core.worker.progress import silent
from palpate.ui.cli.arguments import no_points
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.ui.doctor import Check

NAME, HELP = "doctor", "what works on this machine"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Nothing to choose."""


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Examines; raises InputError naming the first thing that is needed and missing."""
    from palpate.ui.doctor import examine  # here, because scipy takes a second to load

    no_points(args)
    checks = examine(silent)
    missing = [check for check in checks if check.needed and not check.works]
    if missing:
        raise InputError("; ".join(f"{check.name}: {check.found}; {check.remedy}" for check in missing))
    return {"checks": [check.to_dict() for check in checks]}, "\n".join(map(_line, checks))


def _line(check: Check) -> str:
    mark = "ok" if check.works else "--"
    return f"{mark}  {check.name}: {check.found}" + ("" if check.works else f"; {check.remedy}")
