"""The language that drives `palpate touch` by a script, for tests and measurements: one command a line, words as in a shell.

| command | does |
| --- | --- |
| `touch X Y Z` | the probe comes to the organ's surface where it is nearest to a point, patient coordinates, mm LPS |
| `press MM` | reaches so far in beyond the surface at rest, in steps of a quarter of a millimetre; back out with a smaller number |
| `pull MM` | grips the surface and draws it out so far |
| `slide X Y Z` | along the surface at this depth, in steps of a millimetre |
| `release` | back to the surface |
| `radius MM` | of the probe |
| `forget` | the curve begins anew |
| `save NAME` | writes the curve as NAME.csv and NAME.png |
| `expect NAME VALUE` | ends with exit 3 unless a fact has this value: region, ok, solve, touch, answers, ... |
| `above NAME VALUE`, `below NAME VALUE` | the same for a number: force_n, indentation_mm, stiffness_n_per_mm, error_n, ... |
| `resize WIDTH HEIGHT`, `turn AZIMUTH ELEVATION`, `pause SECONDS` | of the window |
| `hold X Y Z DOWN [ACROSS]` | real events of the mouse: left button pressed where that point of the organ is seen, moved by pixels |
| `lift` | the button let go |
| `click WORDS` | a real click on the button with these words |
| `screenshot FILE` | the window as it is, PNG |
| `quit` | ends the script |

Paths are relative to the script's folder. Empty lines and lines that begin with # are passed over.
Every command gives one JSON-able event with the facts after it.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from palpate.applications.touch.window.protocol import Felt, Saved
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.ui.desktop.scripting import script_runner
from palpate.ui.desktop.scripting.script_runner import Command, CommandFacts, Done

# These need the window; a script without them runs without one.
OF_THE_WINDOW = frozenset({"resize", "turn", "pause", "hold", "lift", "click", "screenshot"})


class Feeling(Protocol):
    """Who answers: a `ProbeControl` in this process, or the window's."""

    def touch(self, point: FloatArray) -> Felt:
        """See `ProbeControl`."""

    def press(self, depth: float) -> Felt:
        """See `ProbeControl`."""

    def slide(self, point: FloatArray) -> Felt:
        """See `ProbeControl`."""

    def resize(self, radius: float) -> Felt:
        """See `ProbeControl`."""

    def forget(self) -> Felt:
        """See `ProbeControl`."""

    def save(self, path: Path) -> Saved:
        """See `ProbeControl`."""

    def facts(self) -> Felt:
        """See `ProbeControl`."""


def parse(text: str, source: str) -> list[Command]:
    """The commands of a script. Raises InputError naming the file and the line for one that cannot be understood."""
    return script_runner.parse(text, source, script_runner.names_of(Driver) | OF_THE_WINDOW)


class TouchEvent(Felt, Done):
    """What a command did, and what is felt after it."""


class Driver:
    """Carries out commands. feeling : who answers. folder : paths are relative to it. source : the script's name, for messages."""

    def __init__(self, feeling: Feeling, folder: Path, source: str) -> None:
        self.feeling, self._folder, self._source = feeling, folder, source
        self.over = False

    def run(self, command: Command) -> TouchEvent:
        """Does one command and returns its event. Raises InputError naming the line when it cannot be done."""
        began = time.monotonic()
        told = script_runner.carried_out(self, command, self._source)
        seconds = round(time.monotonic() - began, 3)
        return {"line": command.line, "command": command.name, "seconds": seconds, **self.feeling.facts(), **told}

    def do_touch(self, x: str, y: str, z: str) -> None:
        """The probe comes to a place."""
        self.feeling.touch(np.array([float(x), float(y), float(z)]))

    def do_press(self, depth: str) -> None:
        """So far in."""
        self.feeling.press(float(depth))

    def do_pull(self, height: str) -> None:
        """So far out."""
        self.feeling.press(-float(height))

    def do_slide(self, x: str, y: str, z: str) -> None:
        """Along the surface."""
        self.feeling.slide(np.array([float(x), float(y), float(z)]))

    def do_release(self) -> None:
        """Back to the surface."""
        self.feeling.press(0.0)

    def do_radius(self, radius: str) -> None:
        """Of the probe."""
        self.feeling.resize(float(radius))

    def do_forget(self) -> None:
        """The curve begins anew."""
        self.feeling.forget()

    def do_save(self, name: str) -> CommandFacts:
        """The curve as a table and a picture."""
        return {"files": self.feeling.save(self._folder / name)["files"]}

    def do_expect(self, name: str, value: str) -> None:
        """A fact must have a value."""
        found = str(self._fact(name)).lower()
        if found != value.lower():
            raise InputError(f"{name} is {found}, not {value}")

    def do_above(self, name: str, value: str) -> None:
        """A number must be above."""
        if not self._number(name) > float(value):
            raise InputError(f"{name} is {self._number(name):g}, not above {value}")

    def do_below(self, name: str, value: str) -> None:
        """A number must be below."""
        if not self._number(name) < float(value):
            raise InputError(f"{name} is {self._number(name):g}, not below {value}")

    def do_quit(self) -> None:
        """Ends the script."""
        self.over = True

    def _fact(self, name: str) -> object:
        facts: Mapping[str, object] = self.feeling.facts()
        if name not in facts:
            raise InputError(f"there is no fact {name!r}; there are {', '.join(sorted(facts))}")
        return facts[name]

    def _number(self, name: str) -> float:
        found = self._fact(name)
        if not isinstance(found, int | float) or isinstance(found, bool):
            raise InputError(f"{name} is {found}, no number")
        return float(found)
