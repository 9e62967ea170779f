"""One command of a script carried out by a driver: what the scripts of `open` and `touch` share. Needs no Qt."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from palpate.core.errors import InputError


@dataclass(frozen=True)
class Command:
    """A line of a script: number from 1, the command's name, and its words."""

    line: int
    name: str
    words: tuple[str, ...]


def obeyed(driver: object, command: Command, source: str) -> dict[str, Any]:
    """Calls the driver's ``do_NAME`` with the command's words; what it tells. Raises InputError naming the script and its line."""
    try:
        return getattr(driver, f"do_{command.name}")(*command.words) or {}
    except (TypeError, ValueError) as error:
        form = f"`{command.name} {' '.join(command.words)}` is not of its form ({error})"
        raise InputError(f"{source}, line {command.line}: {form}") from error
    except InputError as error:
        raise InputError(f"{source}, line {command.line}: {error}") from error
