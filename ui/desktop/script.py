"""The language that drives the window without hands, for tests and demonstrations: one command a line, words as in a shell.

docs/desktop.md tells all commands.

Paths are relative to the script's folder. Empty lines and lines that begin with # are passed over.
Every command gives one JSON-able event with the facts after it.
"""

from __future__ import annotations

import os
import shlex
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from palpate.core.errors import InputError
from palpate.segmentation.case import STATES
from palpate.segmentation.labels import LABEL_VALUES
from palpate.ui.desktop import hands
from palpate.ui.desktop.controller import Controller
from palpate.ui.desktop.display import Display
from palpate.ui.desktop.grey import PRESETS
from palpate.ui.desktop.obey import Command, obeyed

_SECONDS = 600.0
# A picture is taken without the 3D view's last state where that takes longer.
_SOLID_SECONDS = 60.0


def parse(text: str, source: str) -> list[Command]:
    """The commands of a script. Raises InputError naming the file and the line for one that cannot be understood."""
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            words = shlex.split(line, comments=True)
        except ValueError as error:
            raise InputError(f"{source}, line {number}: {error}; close the quotation") from error
        if words and not hasattr(Driver, f"do_{words[0]}"):
            known = ", ".join(sorted(name[3:] for name in dir(Driver) if name.startswith("do_")))
            raise InputError(f"{source}, line {number}: no command {words[0]!r}; give one of {known}")
        if words:
            found.append(Command(number, words[0], tuple(words[1:])))
    return found


class Driver:
    """Carries out commands. window : the MainWindow. process : lets the window's events be handled for so many seconds."""

    def __init__(self, window: Any, process: Callable[[float], None], folder: Path, source: str) -> None:
        self.window, self.process, self._folder, self._source = window, process, folder, source
        self.controller: Controller = window.controller
        self.over = False

    def run(self, command: Command) -> dict[str, Any]:
        """Does one command and returns its event. Raises InputError naming the line when it cannot be done."""
        began = time.monotonic()
        told = obeyed(self, command, self._source)
        self.process(0.0)
        seconds = round(time.monotonic() - began, 3)
        return {"line": command.line, "command": command.name, "seconds": seconds, **self.state(), **told}

    def state(self) -> dict[str, Any]:
        """Facts that a script can expect."""
        controller = self.controller
        job, case = controller.jobs.state, controller.case
        return {
            "case": case is not None,
            "unsaved": case is not None and case.corrections.unsaved,
            "job": "none" if job is None else (job.outcome or "running"),
            "cancel_seconds": None if job is None else job.cancel_seconds,
            "said": controller.said,
            "labels": sorted(() if case is None else case.volumes),
            "seeds": 0 if case is None else sum(map(len, case.seeds.values())),
            "simulated": case is not None and bool(case.simulated),
            "steps": {s.step.command: s.state for s in controller.steps()},
        }

    def do_open(self, *paths: str) -> None:
        """One path: a case. Three: rest, deformed, case. Five: and contours of both scans."""
        found = [self._folder / path for path in paths]
        if len(found) == 1:
            self.controller.open_case(found[0])
        elif len(found) in (3, 5):
            self.controller.open_pair(found[0], found[1], found[2], (found[3], found[4]) if found[3:] else (None, None))
        else:
            raise ValueError("one path, three or five")
        self.window.stack.setCurrentIndex(1)
        self.do_wait()
        if self.controller.case is None:
            raise InputError(self.controller.said)

    def do_crosshair(self, x: str, y: str, z: str) -> None:
        """Moves the crosshair."""
        self.controller.look_at(float(x), float(y), float(z))

    def do_show(self, name: str, value: str) -> None:
        """Changes one field of the display, in its own type."""
        before = getattr(Display(), name, ...)
        if before is ... or name == "crosshair":
            raise ValueError(f"nothing is called {name!r}")
        new: Any = value
        if isinstance(before, bool):
            new = value in ("1", "on", "true", "yes")
        elif not isinstance(before, str):
            new = float(value)
        self.controller.show(**{name: int(new) if name == "label" else new})

    def do_preset(self, *words: str) -> None:
        """A preset by its name."""
        name = " ".join(words)
        if name not in PRESETS:
            raise ValueError(f"presets are {', '.join(PRESETS)}")
        self.controller.show(centre=PRESETS[name].centre, width=PRESETS[name].width)

    def do_seed(self, name: str, x: str, y: str, z: str, state: str = "") -> None:
        """Points at an organ."""
        self.controller.editing.seed(state or self._shown(), name, (float(x), float(y), float(z)))

    def do_brush(self, label: str, radius: str, *rest: str) -> None:
        """One stroke with the brush."""
        self._stroke("brush", label, radius, rest)

    def do_eraser(self, label: str, radius: str, *rest: str) -> None:
        """One stroke with the eraser."""
        self._stroke("eraser", label, radius, rest)

    def do_click(self, plane: str, x: str, y: str, z: str, state: str = "") -> None:
        """A click into a view."""
        hands.click(self._view(plane, state), (float(x), float(y), float(z)))

    def do_drag(self, plane: str, *words: str) -> None:
        """From one place to another with the button held."""
        numbers = [float(word) for word in words[:6]]
        view = self._view(plane, words[6] if len(words) > 6 else "")
        hands.drag(view, (numbers[0], numbers[1], numbers[2]), (numbers[3], numbers[4], numbers[5]))

    def do_press(self, *words: str) -> None:
        """A click on a button."""
        hands.press(self.window, " ".join(words))

    def do_undo(self) -> None:
        """Takes the last stroke back."""
        self.controller.editing.undo()

    def do_redo(self) -> None:
        """Makes it again."""
        self.controller.editing.redo()

    def do_save(self) -> None:
        """Writes the labels, and waits till they are written."""
        self.controller.save()
        if self.controller.case is not None:
            self.controller.case.flush()

    def do_run(self, *steps: str) -> None:
        """Starts steps."""
        self.controller.run(*steps)

    def do_cancel(self) -> dict[str, Any]:
        """Stops what runs and waits till it has stopped."""
        self.controller.cancel()
        self._until(lambda: not (self.controller.jobs.running or self.controller.reader.running), 5.0)
        return {"cancel_seconds": self.state()["cancel_seconds"]}

    def do_wait(self, seconds: str = str(_SECONDS)) -> dict[str, Any]:
        """Until nothing runs, and it is known which steps are out of date; then for the 3D view, if so much time is left."""
        began, controller = time.monotonic(), self.controller
        running = (controller.jobs, controller.reader, controller.freshness)
        self._until(lambda: not any(one.running for one in running), float(seconds))
        return {"solid_settled": self._settle(float(seconds) - (time.monotonic() - began))}

    def do_until(self, fraction: str, seconds: str = str(_SECONDS)) -> None:
        """Until the step has come so far, or has ended."""
        job = self.controller.jobs
        self._until(
            lambda: not job.running or (job.state is not None and job.state.fraction >= float(fraction)), float(seconds)
        )

    def do_pause(self, seconds: str) -> None:
        """Lets time pass."""
        self.process(float(seconds))

    def do_resize(self, width: str, height: str) -> dict[str, Any]:
        """Of the window; one that it cannot be is refused."""
        self.process(0.0)  # what is shown now says how small it can be
        least = self.window.minimumSizeHint()
        if int(width) < least.width() or int(height) < least.height():
            raise InputError(f"the window cannot be smaller than {least.width()} x {least.height()}")
        self.window.resize(int(width), int(height))
        self.process(0.0)
        return {"width": self.window.width(), "height": self.window.height()}

    def do_screenshot(self, file: str) -> dict[str, Any]:
        """The window as a picture, once the 3D view has settled."""
        self.process(0.1)
        settled = self._settle(_SOLID_SECONDS)
        self.process(0.1)
        path = self._folder / file
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(f".part-{path.name}")
        if not self.window.grab().save(str(temporary)):
            raise InputError(f"{path} cannot be written; choose another place or a name that ends with .png")
        os.replace(temporary, path)  # whoever waits for the file finds it whole
        return {"file": str(path), "solid_settled": settled}

    def do_stalls(self) -> dict[str, Any]:
        """The longest stall since the last time."""
        meter = self.window.stalls
        told = {"longest_stall_ms": round(meter.longest_ms, 1), "longest_own_ms": round(meter.longest_own_ms, 1)}
        meter.reset()
        return told

    def do_expect(self, name: str, value: str) -> None:
        """A fact must have a value; of `steps` one is named with a dot."""
        facts, (first, _, further) = self.state(), name.partition(".")
        if first not in facts or bool(further) != (first == "steps") or (further and further not in facts["steps"]):
            known = [n for n in facts if n != "steps"] + [f"steps.{n}" for n in facts["steps"]]
            raise InputError(f"there is no fact {name!r}; give one of {', '.join(known)}")
        found = _in_words(facts["steps"][further] if further else facts[first])
        if found.casefold() != value.casefold():
            raise InputError(f"{name} is {found or 'empty'}, not {value or 'empty'}")

    def do_quit(self) -> None:
        """Ends the script."""
        self.over = True

    def _settle(self, seconds: float) -> bool:
        """Waits for the 3D view's picture; whether it has come, or the view is not shown."""
        solid, end = self.window.views.solid, time.monotonic() + min(seconds, _SOLID_SECONDS)
        while solid.isVisible() and not solid.settled and time.monotonic() < end:
            self.process(0.02)
        return bool(solid.settled or not solid.isVisible())

    def _shown(self) -> str:
        """The scan that a person would point at: the one shown, the one at rest where both are."""
        return "deformed" if self.controller.display.mode == "deformed" else "rest"

    def _view(self, plane: str, state: str) -> Any:
        state = state or self._shown()
        found = [
            v
            for v in self.window.views.visible_slices()
            if v.plane.name == plane and state in (v.state, v.editing_state)
        ]
        if not found:
            raise InputError(f"no {plane} view of the {state} scan is shown")
        return found[0]

    def _stroke(self, tool: str, label: str, radius: str, rest: Sequence[str]) -> None:
        state = rest[-1] if rest and rest[-1] in STATES else self._shown()
        numbers = [float(word) for word in (rest[:-1] if rest and rest[-1] in STATES else rest)]
        if not numbers or len(numbers) % 3:
            raise ValueError("points are X Y Z")
        points = [(numbers[n], numbers[n + 1], numbers[n + 2]) for n in range(0, len(numbers), 3)]
        value = LABEL_VALUES[label] if label in LABEL_VALUES else int(label)
        self.controller.show(tool=tool, label=value, radius_mm=float(radius))
        self.controller.editing.begin(state, None, points[0])
        for point in points[1:]:
            self.controller.editing.go_on(None, point)
        self.controller.editing.end()

    def _until(self, done: Callable[[], bool], seconds: float) -> None:
        end = time.monotonic() + seconds
        while not done():
            if time.monotonic() > end:
                raise InputError(f"it was not done after {seconds:g} s; give a longer time")
            self.process(0.02)


def _in_words(value: Any) -> str:
    """A fact as a script writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return ",".join(map(str, value))
    return "none" if value is None else str(value)
