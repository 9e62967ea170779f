"""What a command shows: progress on standard error, its result on standard output."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, redirect_stdout
from typing import TYPE_CHECKING, NoReturn, TextIO

from palpate.core.worker.progress import Progress, silent

if TYPE_CHECKING:
    from tqdm import tqdm

# Where standard error is a file, a line is written at most this often.
_LINE_EVERY_S = 2.0


class Console:
    """as_json : one JSON object on standard output and nothing else. quiet : no progress and no text.

    Used in a ``with`` block: there, what libraries print, those written in C too, goes to standard error.
    """

    def __init__(self, as_json: bool = False, quiet: bool = False) -> None:
        self.as_json, self.quiet = as_json, quiet
        self._kept: int | None = None
        self._python = ExitStack()

    def __enter__(self) -> Console:
        if self.as_json:
            sys.stdout.flush()
            self._kept = os.dup(1)
            os.dup2(2, 1)
            self._python.enter_context(redirect_stdout(sys.stderr))
        return self

    def __exit__(self, *_: object) -> None:
        if self._kept is not None:
            self._python.close()
            sys.stdout.flush()
            os.dup2(self._kept, 1)
            os.close(self._kept)
            self._kept = None

    @contextmanager
    def progress(self, title: str) -> Iterator[Progress]:
        """How a step tells what it is doing: a bar on a terminal, a line now and then in a file."""
        if self.quiet:
            yield silent
        elif sys.stderr.isatty():
            from tqdm import tqdm  # here, as what takes long to load: help comes at once

            layout = "{desc:>9} {percentage:3.0f} %|{bar:24}| {elapsed}, about {remaining} left{postfix}"
            with tqdm(total=1.0, desc=title, bar_format=layout, file=sys.stderr, dynamic_ncols=True) as bar:
                yield _Bar(bar)
        else:
            lines = _Lines(title, sys.stderr)
            yield lines
            lines.end()

    def result(self, data: Mapping[str, object], text: str) -> None:
        """The outcome of a command: ``data`` as JSON, or ``text`` for a person. Call it after the ``with`` block."""
        if self.as_json:
            print(_as_json(data))
        elif not self.quiet:
            print(text)

    def error(self, message: str, exit_code: int, facts: Mapping[str, object] | None = None) -> None:
        """One line on standard error; with --json the same, and what was found before, as an object on standard output."""
        if self.as_json:
            print(_as_json({**(facts or {}), "error": message, "exit_code": exit_code}))
        print(f"palpate: {message}", file=sys.stderr)


def _as_json(data: Mapping[str, object]) -> str:
    from palpate.core.worker.messages import encode  # here, because numpy takes a while to load

    return encode(data)


class _Bar:
    def __init__(self, bar: tqdm[NoReturn]) -> None:
        self._bar = bar

    def __call__(self, fraction: float, message: str) -> None:
        self._bar.set_postfix_str(message, refresh=False)
        self._bar.n = min(max(fraction, 0.0), 1.0)
        self._bar.refresh()


class _Lines:
    def __init__(self, title: str, stream: TextIO) -> None:
        self._title, self._stream = title, stream
        self._last, self._told, self._waiting = -_LINE_EVERY_S, "", ""

    def __call__(self, fraction: float, message: str) -> None:
        self._waiting = f"{self._title} {100.0 * fraction:.0f} %: {message}"
        if time.monotonic() - self._last >= _LINE_EVERY_S:
            self._write()

    def end(self) -> None:
        """Write the line that was held back last."""
        if self._waiting != self._told:
            self._write()

    def _write(self) -> None:
        print(self._waiting, file=self._stream, flush=True)
        self._last, self._told = time.monotonic(), self._waiting
