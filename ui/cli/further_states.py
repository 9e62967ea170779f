"""Options of `import` and `analyze` for more than one deformed state."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import UsageError

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder
    from palpate.case.deformed_states import NewState


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """``--more`` and what goes with it."""
    group = parser.add_argument_group("further deformed states, identified together with the first")
    group.add_argument("--more", type=Path, action="append", default=[], metavar="DEFORMED",
                       help="a further state of the same organ: label volume, or CT with --more-labels; may be "
                       "given several times")  # fmt: skip
    group.add_argument("--more-labels", type=Path, action="append", default=[], metavar="FILE",
                       help="labels drawn on each --more that is a CT, in the same order")  # fmt: skip
    group.add_argument("--more-landmarks", type=Path, action="append", default=[], metavar="CSV",
                       help="matched points of each --more, in the same order")  # fmt: skip


def states_of(args: argparse.Namespace) -> list[NewState]:
    """What a command line asks for. Raises UsageError where options do not belong together."""
    from palpate.case.deformed_states import NewState  # here, because it takes seconds to load
    from palpate.imaging.scans.scan import is_ct

    scans = [path for path in args.more if path.exists() and is_ct(path)]
    for name, given, wanted in (("labels", args.more_labels, scans), ("landmarks", args.more_landmarks, args.more)):
        if given and len(given) != len(wanted):
            raise UsageError(
                f"--more-{name} is given {len(given)} times for {len(wanted)} scans that could have it; give one for each"
            )
    labels, marks = iter(args.more_labels), iter(args.more_landmarks)
    return [
        NewState(path, next(labels, None) if path in scans else None, next(marks, None), not args.no_align)
        for path in args.more
    ]


def add_states(case: CaseFolder, states: list[NewState]) -> list[str]:
    """Adds them to an imported case; a line on each."""
    from palpate.case.deformed_states import add_state

    return [f"state   {case.file(add_state(case, state).labels)}" for state in states]
