"""Drives the window by a script, on a screen or without one."""

from __future__ import annotations

from pathlib import Path
from typing import TypedDict

from palpate.core.errors import Cancelled
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.scripting import script_runner
from palpate.ui.desktop.scripting.commands_script import Driver, WindowEvent
from palpate.ui.desktop.scripting.script_runner import Command
from palpate.ui.desktop.window.application import new_window


class Played(TypedDict):
    """Of a window that a script used."""

    events: list[WindowEvent]


def play(commands: list[Command], folder: Path, source: str, headless: bool = True) -> Played:
    """Drives the window by a script: the events of its commands. Raises InputError naming the line that cannot be done."""
    window, application = new_window(headless)
    window.show()
    window.responsiveness.reset()

    try:
        return {"events": script_runner.play(commands, Driver(window, events_for(application), folder, source))}
    except KeyboardInterrupt as error:
        raise Cancelled("the script was stopped") from error
    finally:
        window.hide()
        window.shut()
