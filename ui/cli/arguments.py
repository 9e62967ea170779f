"""Arguments that commands share, and what a person may have meant by them."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn, TypeVar

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder


N = TypeVar("N", int, float)
# What `--image` does, and when it is done unasked.
IMAGE_HELP = "use the motion that the two CTs' images show, beside the contours (default: where the case has both CTs)"


class UsageError(Exception):
    """The command line cannot be understood (exit 2)."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose errors are exceptions, so that they too can be told as JSON."""

    def error(self, message: str) -> NoReturn:
        """Raises UsageError."""
        raise UsageError(f"{self._in_words(message)}; see {self.prog} --help")

    def _in_words(self, message: str) -> str:
        """What argparse says, with the nearest word for one that does not exist."""
        missing = message.removeprefix("the following arguments are required: ")
        if missing != message:
            return f"{missing} missing"
        extra = message.removeprefix("unrecognized arguments: ")
        if extra != message and not extra.startswith("-"):
            return f"{extra!r} is too much; put a path with blanks in quotation marks"
        found = re.match(r"argument \S+: invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if found is None:
            return message
        known = [word.strip(" '") for word in found[2].split(",")]
        near = get_close_matches(found[1], known, 1, 0.6)
        return f"there is no {found[1]!r}" + (
            f"; did you mean {near[0]}?" if near else f"; choose from {', '.join(known)}"
        )


def common() -> Parser:
    """The options of every command, as a parent parser."""
    parent = Parser(add_help=False)
    group = parent.add_argument_group("common options")
    group.add_argument(
        "--json", action="store_true", help="one JSON object on standard output, progress on standard error"
    )
    group.add_argument(
        "--seed", action="append", default=[], metavar="N|NAME=X,Y,Z",
        help="a whole number: seed of the random numbers (default 1). With an equals sign, where a command segments: a point "
        "in an organ in patient coordinates (LPS, mm), e.g. prostate=-6.5,11,-148. May be given several times",
    )  # fmt: skip
    group.add_argument("--workers", type=whole_number(1, 256), default=None, metavar="N",
                       help="processes to use; results do not depend on it (default: the cores of this machine)")  # fmt: skip
    group.add_argument("--quiet", action="store_true", help="no progress, and nothing but errors without --json")
    return parent


def whole_number(low: int, high: int) -> Callable[[str], int]:
    """An argparse type: a whole number from low to high."""
    return _within(int, "whole number", low, high)


def number(low: float, high: float) -> Callable[[str], float]:
    """An argparse type: a number from low to high."""
    return _within(float, "number", low, high)


def _within(convert: Callable[[str], N], words: str, low: N, high: N) -> Callable[[str], N]:
    def parse(text: str) -> N:
        try:
            value = convert(text)
        except ValueError:
            raise argparse.ArgumentTypeError(f"{text!r} is not a {words}") from None
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{value:.12g} is out of range; give {low:.12g} to {high:.12g}")
        return value

    return parse


def random_seed(args: argparse.Namespace, default: int = 1) -> int:
    """The whole number among the ``--seed`` options; the last one counts. Raises UsageError when one is neither form."""
    seed = default
    for text in args.seed:
        if "=" in text:
            continue
        try:
            seed = int(text)
        except ValueError:
            raise UsageError(f"--seed {text}: give a whole number, or NAME=X,Y,Z for a point in an organ") from None
        if not 0 <= seed < 2**31:
            raise UsageError(f"--seed {text}: give a number from 0 to {2**31 - 1}")
    return seed


def points(args: argparse.Namespace) -> list[str]:
    """The ``--seed`` options that are points: NAME=X,Y,Z."""
    return [text for text in args.seed if "=" in text]


def no_points(args: argparse.Namespace) -> None:
    """Raises UsageError when a command that does not segment was given a point."""
    if points(args):
        raise UsageError(f"--seed {points(args)[0]}: only `segment` and `analyze` take points; give a whole number")


def workers(args: argparse.Namespace) -> int:
    """Processes to use."""
    from palpate.core.worker.executors import cores  # here, because help needs no processes

    return int(args.workers or cores())


def add_case(parser: argparse.ArgumentParser) -> None:
    """The positional argument of a command that works on an existing case."""
    parser.add_argument("case", type=Path, metavar="CASE", help="the case folder")


def has_case(args: argparse.Namespace) -> None:
    """Raises InputError where CASE is no case folder; told before what works on it is loaded, which takes seconds."""
    from palpate.case.case_files import require_case  # here, so that the list of options needs no library

    require_case(args.case)


def case_of(args: argparse.Namespace) -> CaseFolder:
    """CASE of a command that takes no points. Raises UsageError where one was given, InputError where CASE is no case folder."""
    no_points(args)
    has_case(args)
    from palpate.case.case_folder import CaseFolder  # here, because it and VTK take seconds to load

    return CaseFolder(args.case)


def add_roi(parent: argparse._ActionsContainer, words: str) -> None:
    """The option that says which structures are which organ. parent : a parser or a group of one."""
    parent.add_argument("--roi", action="append", default=[], metavar="ORGAN=NAME[,NAME]", help=words)


def roi_of(texts: list[str]) -> dict[str, list[str]]:
    """Organ -> names of its structures, of what was given as ``--roi``. Raises UsageError for a malformed one."""
    found: dict[str, list[str]] = {}
    for text in texts:
        organ, equals, names = text.partition("=")
        if not (organ and equals and names):
            raise UsageError(f"--roi {text}: write ORGAN=NAME, e.g. prostate=Prostata")
        found.setdefault(organ, []).extend(name for name in names.split(",") if name)
    return found
