"""The language that drives the window by a script, for tests and demonstrations: one command a line, words as in a
shell.

docs/desktop.md tells all commands.

Paths are relative to the script's folder. Empty lines and lines that begin with # are passed over.
Every command gives one JSON-able event with the facts after it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from palpate.core.errors import InputError
from palpate.ui.desktop.scripting import script_runner, synthetic_input
from palpate.ui.desktop.scripting.script_edits import Correcting
from palpate.ui.desktop.scripting.script_facts import WindowFacts, expect, facts_of
from palpate.ui.desktop.scripting.script_runner import Command, CommandFacts, Done
from palpate.ui.desktop.session.display import PRESETS, Display

if TYPE_CHECKING:
    from palpate.ui.desktop.slices.slice_view import SliceView
    from palpate.ui.desktop.window.main_window import MainWindow

_SECONDS = 600.0
# A picture is taken without the 3D view's last state where that takes longer.
_SOLID_SECONDS = 60.0


def parse(text: str, source: str) -> list[Command]:
    """The commands of a script. Raises InputError naming the source and the line for one that cannot be understood."""
    return script_runner.parse(text, source, script_runner.names_of(Driver))


class WindowEvent(WindowFacts, Done):
    """What a command did, and the facts after it."""


class Driver(Correcting):
    """Carries out commands. process : lets the window's events be handled for so many seconds."""

    def __init__(self, window: MainWindow, process: Callable[[float], None], folder: Path, source: str) -> None:
        super().__init__(window.controller)
        self.window, self.process, self._folder, self._source = window, process, folder, source
        self.over = False

    def run(self, command: Command) -> WindowEvent:
        """Does one command and returns its event. Raises InputError naming the line when it cannot be done."""
        began = time.monotonic()
        told = script_runner.carried_out(self, command, self._source)
        self.process(0.0)
        seconds = round(time.monotonic() - began, 3)
        return {"line": command.line, "command": command.name, "seconds": seconds, **facts_of(self.controller), **told}

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
        new: bool | int | float | str = value
        if isinstance(before, bool):
            new = value in ("1", "on", "true", "yes")
        elif not isinstance(before, str):
            new = int(float(value)) if name == "label" else float(value)
        self.controller.show(**{name: new})

    def do_preset(self, *words: str) -> None:
        """A preset by its name."""
        name = " ".join(words)
        if name not in PRESETS:
            raise ValueError(f"presets are {', '.join(PRESETS)}")
        self.controller.show(centre=PRESETS[name].centre, width=PRESETS[name].width)

    def do_click(self, plane: str, x: str, y: str, z: str, state: str = "") -> None:
        """A click into a view."""
        synthetic_input.click(self._view(plane, state), (float(x), float(y), float(z)))

    def do_drag(self, plane: str, *words: str) -> None:
        """From one place to another with the button held."""
        numbers = [float(word) for word in words[:6]]
        view = self._view(plane, words[6] if len(words) > 6 else "")
        synthetic_input.drag(view, (numbers[0], numbers[1], numbers[2]), (numbers[3], numbers[4], numbers[5]))

    def do_press(self, *words: str) -> None:
        """A click on a button."""
        synthetic_input.press(self.window, " ".join(words))

    def do_run(self, *steps: str) -> None:
        """Starts steps."""
        self.controller.run(*steps)

    def do_touch(self, file: str = "") -> CommandFacts:
        """Opens the probe's window on the organ and waits till it is ready; with a file, its picture."""
        self.controller.touch()
        self._until(lambda: not self.controller.jobs.running, _SECONDS)
        probe = self.window.organ.touching
        if probe is None:
            raise InputError(self.controller.said)
        self._until(lambda: self.window.organ.settled, _SOLID_SECONDS)
        return {"file": str(synthetic_input.shot(probe, self._folder / file))} if file else {}

    def do_drop(self, film: str) -> None:
        """Starts the film of the organ's fall."""
        self.controller.drop(self._folder / film)

    def do_cancel(self) -> None:
        """Stops what runs and waits till it has stopped; the facts say in how many seconds."""
        self.controller.cancel()
        self._until(lambda: not (self.controller.jobs.running or self.controller.reader.running), 5.0)

    def do_wait(self, seconds: str = str(_SECONDS)) -> CommandFacts:
        """Until nothing runs, and it is known which steps are out of date; then for the 3D view, if so much time is
        left.
        """
        began, controller = time.monotonic(), self.controller
        running = (controller.jobs, controller.reader, controller.out_of_date_check)
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

    def do_resize(self, width: str, height: str) -> CommandFacts:
        """Of the window; one that it cannot be is refused."""
        self.process(0.0)  # what is shown now says how small it can be
        least = self.window.minimumSizeHint()
        if int(width) < least.width() or int(height) < least.height():
            raise InputError(f"the window cannot be smaller than {least.width()} x {least.height()}")
        self.window.resize(int(width), int(height))
        self.process(0.0)
        return {"width": self.window.width(), "height": self.window.height()}

    def do_screenshot(self, file: str) -> CommandFacts:
        """The window as a picture, once the 3D view has settled."""
        self.process(0.1)
        settled = self._settle(_SOLID_SECONDS)
        self.process(0.1)
        path = synthetic_input.shot(self.window, self._folder / file)
        return {"file": str(path), "solid_settled": settled}

    def do_stalls(self) -> CommandFacts:
        """The longest stall since the last time."""
        meter = self.window.responsiveness
        told: CommandFacts = {
            "longest_stall_ms": round(meter.longest_ms, 1),
            "longest_own_ms": round(meter.longest_own_ms, 1),
        }
        meter.reset()
        return told

    def do_expect(self, name: str, value: str) -> None:
        """A fact must have a value; of `steps` one is named with a dot."""
        expect(facts_of(self.controller), name, value)

    def do_quit(self) -> None:
        """Ends the script."""
        self.over = True

    def _settle(self, seconds: float) -> bool:
        """Waits for the 3D view's picture; whether it has come, or the view is not shown."""
        solid, end = self.window.views.solid, time.monotonic() + min(seconds, _SOLID_SECONDS)
        while solid.isVisible() and not solid.settled and time.monotonic() < end:
            self.process(0.02)
        return bool(solid.settled or not solid.isVisible())

    def _view(self, plane: str, state: str) -> SliceView:
        state = state or self.shown()
        found = [
            v
            for v in self.window.views.visible_slices()
            if v.plane.name == plane and state in (v.state, v.editing_state)
        ]
        if not found:
            raise InputError(f"no {plane} view of the {state} scan is shown")
        return found[0]

    def _until(self, done: Callable[[], bool], seconds: float) -> None:
        end = time.monotonic() + seconds
        while not done():
            if time.monotonic() > end:
                raise InputError(f"it was not done after {seconds:g} s; give a longer time")
            self.process(0.02)
