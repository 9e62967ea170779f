"""Opens the desktop window: two scans to a report by six buttons, with the slices, 3D, corrections and the swarm at work.

Drop two DICOM folders into it, or give a case folder. With --headless --script it does what a script says, without a
screen; the script's commands are listed in docs/desktop.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import UsageError, no_points
from palpate.ui.cli.console import Console

if TYPE_CHECKING:
    from palpate.ui.desktop.scripting.commands_script import WindowEvent

NAME, HELP = "open", "the desktop window"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """[CASE], and how to drive it without hands."""
    parser.add_argument(
        "case", type=Path, nargs="?", metavar="CASE", help="the case folder; without one, the first page"
    )
    parser.add_argument("--headless", action="store_true", help="without a screen; needs --script")
    parser.add_argument(
        "--script", type=Path, metavar="FILE", help="what to do, one command a line, instead of waiting for a person"
    )


def run(args: argparse.Namespace, console: Console) -> tuple[Mapping[str, object], str]:
    """Opens; see `application.show` and `scripting.play`."""
    from palpate.ui.desktop.window import application  # here, because Qt takes a second to load

    no_points(args)
    if args.headless and args.script is None:
        raise UsageError("--headless needs --script FILE: without a screen nobody can press a button")
    if args.script is None:
        found = application.show(args.case)
        return found, ""
    from palpate.ui.desktop.scripting.commands_script import parse
    from palpate.ui.desktop.scripting.play import play
    from palpate.ui.desktop.scripting.script_runner import Command, read_script

    commands = parse(read_script(args.script), str(args.script))
    if args.case is not None:
        commands.insert(0, Command(0, "open", (str(args.case),)))
    played = play(commands, args.script.absolute().parent, str(args.script), args.headless)
    return played, "\n".join(_line(event) for event in played["events"])


def _line(event: WindowEvent) -> str:
    extra = [f"file {event['file']}"] if "file" in event else []
    extra += [f"longest_stall_ms {event['longest_stall_ms']}"] if "longest_stall_ms" in event else []
    extra += [f"longest_own_ms {event['longest_own_ms']}"] if "longest_own_ms" in event else []
    return f"{event['line']:4} {event['command']:10} {event['seconds']:8.2f} s  {' '.join(extra)}".rstrip()
