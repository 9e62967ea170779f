"""The history of a case that commands ran on: each as it would be typed again, without paths, for a folder's name may be a patient's."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

from palpate.ui.cli.arguments import Parser, common

if TYPE_CHECKING:
    from palpate.case.case_folder import CaseFolder

# These change nothing in what is found.
HIDDEN = ("help", "json", "quiet", "workers")
# What goes before the colon of ``--model`` is a kind, what follows a folder.
_MODEL = "model"


def recorded(case: CaseFolder, args: argparse.Namespace) -> AbstractContextManager[None]:
    """Notes in the case, when the block has ended well, that this command ran on it: the report's provenance."""
    from palpate.case import history  # here, because it takes seconds to load

    return history.recorded(case, args.command, typed_options(args, args._module))


def record(case: CaseFolder, args: argparse.Namespace, seconds: float) -> None:
    """Adds a command to the case's history, as it would be typed again; paths are left out of it."""
    from palpate.case import history

    history.add_entry(case, args.command, typed_options(args, args._module), seconds)


def typed_options(args: argparse.Namespace, module: ModuleType) -> str:
    """All but the command's name, in a form that its parser accepts: ``REST DEFORMED -o CASE --no-map``.

    Defaults are left out; paths are what the help calls them. module : of the command, with ``add_arguments``.
    """
    parser = Parser(parents=[common()])
    module.add_arguments(parser)
    places: list[str] = []
    options: list[str] = []
    for action in parser._actions:
        value = getattr(args, action.dest, action.default)
        if action.dest in HIDDEN or value is None or (value == action.default and not action.required):
            continue
        if action.option_strings:
            options += _option(action, value)
        else:
            places += [_plain(action, one) for one in (value if isinstance(value, list) else [value])]
    return " ".join([*places, *options])


def _option(action: argparse.Action, value: object) -> list[str]:
    name = action.option_strings[0]
    if action.nargs == 0:  # a flag, or one that switches off
        return [name]
    if isinstance(action.nargs, str | int) and isinstance(value, Sequence) and not isinstance(value, str):
        return [" ".join([name, *(_plain(action, one) for one in value)])]
    each = value if isinstance(action, argparse._AppendAction) and isinstance(value, list) else [value]
    return [_joined(name, _plain(action, one)) for one in each]


def _joined(name: str, value: str) -> str:
    """A value that looks like an option is tied to its own."""
    return f"{name}={value}" if value.startswith("-") and name.startswith("--") else f"{name} {value}"


def _plain(action: argparse.Action, value: object) -> str:
    """One value; a path is what the help calls it."""
    metavar = str(action.metavar or action.dest.upper())
    if isinstance(value, Path):
        return metavar
    if isinstance(value, tuple) and any(isinstance(part, Path) for part in value):
        wanted = metavar.rpartition("=")[2]
        return shlex.quote("=".join(wanted if isinstance(part, Path) else str(part) for part in value))
    if action.dest == _MODEL and ":" in str(value):
        return f"{str(value).partition(':')[0]}:FOLDER"
    if isinstance(value, tuple | list):
        return shlex.quote(",".join(f"{part:g}" if isinstance(part, float) else str(part) for part in value))
    return shlex.quote(str(value))
