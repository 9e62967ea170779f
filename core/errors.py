"""Errors that end a command, each with the exit status the command line gives for it."""

from __future__ import annotations

from collections.abc import Mapping


class PalpateError(Exception):
    """Base of the errors a person is shown as one line. ``exit_code`` is the process's exit status.

    ``facts``: what had been found before, JSON-able, for who asked for JSON.
    """

    exit_code = 1
    facts: Mapping[str, object] = {}


class InputError(PalpateError):
    """Bad input: says which file, what is wrong with it, and what to do (exit 3)."""

    exit_code = 3


class ConvergenceError(PalpateError):
    """The numerics found no acceptable answer (exit 4)."""

    exit_code = 4


class Cancelled(PalpateError):
    """The person, or the program on the person's behalf, asked for a stop (exit 130)."""

    exit_code = 130
