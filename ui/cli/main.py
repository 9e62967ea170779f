"""The command line: one subcommand a file, one line for every error, exit codes that scripts can rely on.

0 done, 2 wrong usage, 3 bad input, 4 no convergence, 5 an error of the program itself, 130 cancelled.
"""

from __future__ import annotations

import argparse
import importlib
import os
import pkgutil
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType

from palpate import __version__
from palpate.core.errors import PalpateError
from palpate.core.files.places import check_utf8
from palpate.ui.cli import commands
from palpate.ui.cli.arguments import Parser, UsageError, common
from palpate.ui.cli.console import Console
from palpate.ui.cli.signals import CANCELLED, EXIT_CODE, cancellable, nothing_left

# The room above this one: nothing imports it, its commands are named here.
_APPLICATIONS = "palpate.applications.commands."
# In the order of a case's way, with the two whose name no module can have; a command that is not among them comes after.
_FIRST = {
    "demo": "demo", "analyze": "analyze", "batch": "batch", "import": "import_scans", "segment": "segment",
    "mesh": "mesh", "identify": "identify",
    "diagnose": "diagnose", "report": "report", "simulate": "simulate", "export": "export", "plan": "plan", "bench": "bench",
    "validate": "validate", "drop": _APPLICATIONS + "drop", "sketch": _APPLICATIONS + "sketch",
    "open": "open_window", "touch": _APPLICATIONS + "touch", "doctor": "doctor",
}  # fmt: skip


def find_commands() -> dict[str, str]:
    """Modules of `commands` by the name of their command: each has NAME, HELP, add_arguments(parser) and
    run(args, console) -> (data, text)."""
    there = {m.name for m in pkgutil.iter_modules(commands.__path__)} - set(_FIRST.values())
    return _FIRST | {name.replace("_", "-"): name for name in sorted(there)}


COMMANDS = find_commands()
_DESCRIPTION = (
    "Feels an organ through two CT scans: one at rest, one in which the organ is deformed. Research use only. "
    "Ends with 0 done, 2 wrong usage, 3 bad input, 4 no convergence, 5 error of the program, 130 cancelled."
)


# An error that nobody foresaw, and where to tell of it.
UNFORESEEN = 5
_REPORT = "this is an error of Palpate: please report it with the command and this line (CONTRIBUTING.md says where)"
_TRACEBACK = "PALPATE_TRACEBACK"
# Arguments that name what a command writes.
_WRITTEN = ("output", "folder", "answers")


def entry() -> None:
    """The installed script."""
    sys.exit(main())


def main(argv: Sequence[str] | None = None) -> int:
    """Runs one command and returns its exit status."""
    given = list(sys.argv[1:] if argv is None else argv)
    open_streams()
    console = Console("--json" in given, "--quiet" in given)
    try:
        with nothing_left(), cancellable():
            return _run(given, console)
    except KeyboardInterrupt:
        console.error(CANCELLED, EXIT_CODE)
        return EXIT_CODE
    except BrokenPipeError:  # who read the output has gone; what is left to write goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return EXIT_CODE
    except PalpateError as error:
        console.error(one_line(str(error)), error.exit_code, facts=error.facts)
        return error.exit_code
    except UsageError as error:
        console.error(one_line(str(error)), 2)
        return 2
    except OSError as error:
        console.error(_os_error(error), 3)
        return 3
    except Exception as error:  # the last catch: one line instead of a traceback
        if os.environ.get(_TRACEBACK):
            raise
        console.error(_unforeseen(error), UNFORESEEN)
        return UNFORESEEN


def parser(given: Sequence[str] = ()) -> Parser:
    """The command line: of the one command that ``given`` names, or the list of all, each without its options.

    Only what is asked for is loaded: `doctor` can speak where a library of another command is broken, and the list comes at once.
    """
    word = next((word for word in given if not word.startswith("-")), None)
    named = word if word in COMMANDS else None
    top = Parser(prog="palpate", description=_DESCRIPTION)
    top.add_argument("--version", action="version", version=f"palpate {__version__}")
    listed = top.add_subparsers(dest="command", required=True, metavar="COMMAND")
    shared = common()
    for module in map(command_module, COMMANDS if named is None else [named]):
        sub = listed.add_parser(
            module.NAME, help=module.HELP, description=module.__doc__, parents=[shared],
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        if named is not None:
            module.add_arguments(sub)
        sub.set_defaults(_module=module)
    return top


def arguments(given: Sequence[str]) -> argparse.Namespace:
    """A command line, read. Raises UsageError."""
    return parser(given).parse_args(given)


def one_line(text: str) -> str:
    """The text without line breaks."""
    return " ".join(text.split())


def _run(given: Sequence[str], console: Console) -> int:
    args = arguments(given)
    for name in _WRITTEN:
        if isinstance(path := getattr(args, name, None), Path):
            check_utf8(path, "choose another")
    with console:
        data, text = args._module.run(args, console)
    console.result(data, text)
    sys.stdout.flush()
    return 0


def command_module(name: str) -> ModuleType:
    """The module of a command."""
    return importlib.import_module(
        COMMANDS[name] if "." in COMMANDS[name] else f"palpate.ui.cli.commands.{COMMANDS[name]}"
    )


def open_streams() -> None:
    """Opens standard streams that were closed, as under some job runners, on nothing: output has a place to go."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            mode = os.O_RDONLY if number == 0 else os.O_WRONLY
            opened = os.open(os.devnull, mode)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", closefd=False, encoding="utf-8"))


def _unforeseen(error: Exception) -> str:
    """Kind and place of an error. Its text may hold a patient's name: it is left out."""
    places = traceback.extract_tb(error.__traceback__)
    own = [place for place in places if "palpate" in place.filename or "/ui/" in place.filename] or places
    at = f" in {Path(own[-1].filename).name}, line {own[-1].lineno}" if own else ""
    return f"{type(error).__name__}{at}; {_REPORT}; {_TRACEBACK}=1 shows where it came from"


def _os_error(error: OSError) -> str:
    """A refusal of the operating system in the form of an input error: which path, what is wrong, what to do."""
    where = error.filename2 or error.filename
    what = error.strerror or type(error).__name__
    if where is None:
        return f"{what}; check disk space and permissions"
    return f"{where}: {what}; check the path, or choose a writable place"
