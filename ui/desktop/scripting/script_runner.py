"""Scripts that drive `open` and `touch`: how they are read and carried out. Needs no Qt."""

from __future__ import annotations

import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol, TypedDict, TypeVar

from palpate.core.errors import InputError


@dataclass(frozen=True)
class Command:
    """A line of a script: number from 1, the command's name, and its words."""

    line: int
    name: str
    words: tuple[str, ...]


class CommandFacts(TypedDict, total=False):
    """What commands tell beside the facts: files written, the size of the window, stalls (ms), whether the 3D view has settled."""

    files: list[str]
    file: str
    width: int
    height: int
    longest_stall_ms: float
    longest_own_ms: float
    solid_settled: bool
    settled: bool


class Done(CommandFacts):
    """Which command was carried out, and in how many seconds."""

    line: int
    command: str
    seconds: float


Event = TypeVar("Event", bound=Done)
EventOf = TypeVar("EventOf", bound=Done, covariant=True)


class Driver(Protocol[EventOf]):
    """Carries out commands, each by its own method ``do_NAME``. over : whether the script has ended itself."""

    over: bool

    def run(self, command: Command) -> EventOf:
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


def play(commands: list[Command], driver: Driver[Event]) -> list[Event]:
    """The events of the commands, up to `quit`. An InputError carries the events before it: they are true all the same."""
    events: list[Event] = []
    try:
        for command in commands:
            events.append(driver.run(command))
            if driver.over:
                break
    except InputError as error:
        error.facts = {"events": events}
        raise
    return events


def carried_out(driver: object, command: Command, source: str) -> CommandFacts:
    """Calls the driver's ``do_NAME`` with the command's words; what it tells. Raises InputError naming the script and its line."""
    try:
        told: CommandFacts | None = getattr(driver, f"do_{command.name}")(*command.words)
        return told or {}
    except (TypeError, ValueError) as error:
        form = f"`{command.name} {' '.join(command.words)}` is not of its form ({error})"
        raise InputError(f"{source}, line {command.line}: {form}") from error
    except InputError as error:
        raise InputError(f"{source}, line {command.line}: {error}") from error
