"""Scripts that drive `open` and `touch` without hands, as far as both are alike: how they are read and carried out. Needs no Qt."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from palpate.core.errors import InputError


@dataclass(frozen=True)
class Command:
    """A line of a script: number from 1, the command's name, and its words."""

    line: int
    name: str
    words: tuple[str, ...]


class Driver(Protocol):
    """Carries out commands, each by its own method ``do_NAME``. over : whether the script has ended itself."""

    over: bool

    def run(self, command: Command) -> dict[str, Any]:
        """Does one command and returns its event. Raises InputError naming the line when it cannot be done."""


def read_script(path: Path) -> str:
    """A script's text. Raises InputError naming the file."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable script; give a text file with one command a line") from error


def names_of(driver: type) -> set[str]:
    """The commands that a driver's class carries out."""
    return {name.removeprefix("do_") for name in dir(driver) if name.startswith("do_")}


def parse(text: str, source: str, known: Iterable[str]) -> list[Command]:
    """The commands of a script; `known` names all there are.

    Raises InputError naming the source and the line for one that cannot be understood.
    """
    names = sorted(known)
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            raise InputError(f"{source}, line {number}: {error}; close the quotation") from error
        if words and words[0] not in names:
            raise InputError(f"{source}, line {number}: no command {words[0]!r}; give one of {', '.join(names)}")
        if words:
            found.append(Command(number, words[0], tuple(words[1:])))
    return found


def play(commands: list[Command], driver: Driver) -> list[dict[str, Any]]:
    """The events of the commands, up to `quit`. An InputError carries the events before it: they are true all the same."""
    events: list[dict[str, Any]] = []
    try:
        for command in commands:
            events.append(driver.run(command))
            if driver.over:
                break
    except InputError as error:
        error.facts = {"events": events}
        raise
    return events


def obeyed(driver: object, command: Command, source: str) -> dict[str, Any]:
    """Calls the driver's ``do_NAME`` with the command's words; what it tells. Raises InputError naming the script and its line."""
    try:
        return getattr(driver, f"do_{command.name}")(*command.words) or {}
    except (TypeError, ValueError) as error:
        form = f"`{command.name} {' '.join(command.words)}` is not of its form ({error})"
        raise InputError(f"{source}, line {command.line}: {form}") from error
    except InputError as error:
        raise InputError(f"{source}, line {command.line}: {error}") from error
