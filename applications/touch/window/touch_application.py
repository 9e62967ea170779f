"""Starts the window of `palpate touch`: for a person, or for a script, with a screen or without."""

from __future__ import annotations

import signal
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NotRequired, TypedDict

import numpy as np

from palpate.applications.touch.body import Body
from palpate.applications.touch.window.touch_script import Driver, TouchEvent
from palpate.core.errors import Cancelled, InputError
from palpate.ui.desktop.scripting.script_runner import Command, CommandFacts, play
from palpate.ui.pictures.colours import StiffnessScale

if TYPE_CHECKING:
    from collections.abc import Callable

    from PySide6.QtCore import QPoint

    from palpate.applications.touch.window.protocol import Felt
    from palpate.applications.touch.window.window import TouchWindow

_SETTLE_S = 60.0


class Nothing(TypedDict):
    """Before the probe is ready."""


class Touched(TypedDict):
    """The events of a script; of a window that a person used what was felt last."""

    events: list[TouchEvent]
    last: NotRequired[Felt | Nothing]


@dataclass(frozen=True, eq=False)
class Probed:
    """What is touched: body, radius of the probe in mm, and the colours of the stiffness."""

    body: Body
    radius: float
    scale: StiffnessScale


@dataclass(frozen=True)
class Playing:
    """commands : none where a person works. folder : their paths are relative to it. source : the script's name, for messages."""

    commands: list[Command]
    folder: Path
    source: str


def show(probed: Probed, output: Path, headless: bool, playing: Playing) -> Touched:
    """Opens the window; plays the commands and closes it, or without any waits till a person does. The events, and what was felt last.

    Raises InputError when a command cannot be done; `display_server.check` says beforehand whether a window can be opened.
    """
    from palpate.ui.desktop.qt_application import events_for, qt_application

    application = qt_application(headless)
    from palpate.applications.touch.window.model import TouchModel  # here, because the platform is chosen before
    from palpate.applications.touch.window.window import TouchWindow

    process = events_for(application)
    with tempfile.TemporaryDirectory(prefix="palpate-touch-") as scratch:
        model = TouchModel(probed.body, probed.radius, Path(scratch), process, probed.scale)
        window = TouchWindow(model, output)
        window.show()
        ended = [signal.signal(number, lambda *_: application.quit()) for number in (signal.SIGTERM, signal.SIGINT)]
        try:
            if playing.commands:
                driver = WindowDriver(window, process, playing.folder, playing.source)
                return {"events": play(playing.commands, driver)}
            application.exec()
            return {"events": [], "last": model.facts_now or {}}
        except KeyboardInterrupt as error:
            raise Cancelled("the window was stopped") from error
        finally:
            for number, before in zip((signal.SIGTERM, signal.SIGINT), ended, strict=True):
                signal.signal(number, before)
            window.hide()
            window.shut()


class WindowDriver(Driver):
    """Commands that need the window: real events of mouse and buttons, and pictures of it."""

    def __init__(self, window: TouchWindow, process: Callable[[float], None], folder: Path, source: str) -> None:
        super().__init__(window.model, folder, source)
        self.window, self.process = window, process
        self._held: QPoint | None = None

    def do_resize(self, width: str, height: str) -> None:
        """Of the window, pixels."""
        self.window.resize(int(width), int(height))
        self.process(0.05)

    def do_turn(self, azimuth: str, elevation: str) -> None:
        """Looks from there, degrees."""
        self.window.view.turn(float(azimuth), float(elevation))

    def do_pause(self, seconds: str) -> None:
        """Lets time pass."""
        self.process(float(seconds))

    def do_hold(self, x: str, y: str, z: str, down: str, across: str = "0") -> None:
        """The left button pressed on a point of the organ, and moved a pixel at a time as a hand would."""
        from PySide6.QtCore import QPoint, Qt
        from PySide6.QtTest import QTest

        view = self.window.view
        self.feeling.facts()  # the probe must be ready
        at = QPoint(*(round(c) for c in view.pixel(np.array([float(x), float(y), float(z)]))))
        if not view.rect().contains(at) or view.place(at.toPointF()) is None:
            raise InputError("that place is not seen; turn the organ")
        QTest.mousePress(view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, at)
        steps = max(1, round(max(abs(float(down)), abs(float(across)))))
        for k in range(1, steps + 1):
            self._held = at + QPoint(round(float(across) * k / steps), round(float(down) * k / steps))
            QTest.mouseMove(view, self._held)
            self.process(0.008)

    def do_lift(self) -> None:
        """The button let go."""
        from PySide6.QtCore import Qt
        from PySide6.QtTest import QTest

        if self._held is None:
            raise InputError("no button is held; hold a point first")
        QTest.mouseRelease(self.window.view, Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier, self._held)
        self._held = None

    def do_click(self, *words: str) -> None:
        """A click on a button."""
        from palpate.ui.desktop.scripting import synthetic_input

        synthetic_input.press(self.window, " ".join(words))

    def do_screenshot(self, file: str) -> CommandFacts:
        """The window as a picture, once everything that was asked has come."""
        from palpate.ui.desktop.scripting import synthetic_input

        view, end = self.window.view, time.monotonic() + _SETTLE_S
        self.process(0.05)
        while not view.settled and time.monotonic() < end:
            self.process(0.02)
        self.process(0.05)
        path = synthetic_input.shot(self.window, self._folder / file)
        return {"file": str(path), "settled": view.settled}
