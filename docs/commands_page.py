"""The page of all commands, from the parsers themselves; the site makes it at every build (docs/site_hooks.py)."""

from __future__ import annotations

import argparse
import html
import re

from palpate.ui.cli.arguments import common
from palpate.ui.cli.main import COMMANDS, parser

_INTRODUCTION = """# Commands

`./run palpate COMMAND --help` says the same. Every command ends with 0 done, 2 wrong usage, 3 bad input (one line: which file,
what is wrong, what to do), 4 no convergence, or 130 cancelled. Results do not depend on `--workers`; the same `--seed` gives the
same answer.

## Options of all commands"""


def commands_page() -> str:
    """Markdown: every command with its description, usage and options."""
    shared = [action for action in common()._actions if action.option_strings]
    flags = {flag for action in shared for flag in action.option_strings} | {"--help"}
    parts = [_INTRODUCTION, _table(shared)]
    for name in COMMANDS:
        parts += _command(name, flags)
    return "\n\n".join(part for part in parts if part) + "\n"


def _command(name: str, shared: set[str]) -> list[str]:
    """Sections of one command. shared : flags that are told elsewhere."""
    sub = _parser_of(name)
    own = [action for action in sub._actions if not shared & set(action.option_strings)]
    usage = sub.format_usage().removeprefix("usage: ").strip()
    return [f"## {name}", _escaped(sub.description or ""), f"```text\n{usage}\n```", _table(own)]


def _parser_of(name: str) -> argparse.ArgumentParser:
    """Parser of one command, out of the parser that knows it."""
    (group,) = (action for action in parser([name])._actions if isinstance(action, argparse._SubParsersAction))
    found = group.choices[name]
    assert isinstance(found, argparse.ArgumentParser)
    return found


def _table(actions: list[argparse.Action]) -> str:
    rows = [f"| {_flags(action)} | {_help(action)} |" for action in actions]
    return "\n".join(["| option | means |", "| --- | --- |", *rows]) if rows else ""


def _flags(action: argparse.Action) -> str:
    """Flags and the word for the value; as HTML, because a bar would end the cell."""
    value = argparse.HelpFormatter("palpate")._format_args(action, action.dest.upper()) if action.nargs != 0 else ""
    shown = f"{', '.join(action.option_strings)} {value}".strip()
    return f"<code>{html.escape(shown)}</code>".replace("|", "&#124;")


def _help(action: argparse.Action) -> str:
    text = (action.help or "") % {**vars(action), "prog": "palpate"}
    if action.choices is not None and action.metavar is not None:
        text += f" ({', '.join(map(str, action.choices))})"
    return _escaped(text).replace("\n", " ")


def _escaped(text: str) -> str:
    """Text without Markdown's own meaning: names with underscores and angle brackets stay as they are."""
    return re.sub(r"([\\*_<>|])", r"\\\1", text)
