"""Pages and films that other programs of the machine show: the report in the web browser, a film in a player."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QUrl
from PySide6.QtGui import QDesktopServices

from palpate.ui.desktop.session.controller import Controller


def show_outside(controller: Controller, path: Path) -> None:
    """Shows a file or folder in the program that the desktop has for it; says so where there is none."""
    there = path.absolute()
    if not there.exists():
        controller.say(f"{there} is not there; run the step that writes it again")
    elif not QDesktopServices.openUrl(QUrl.fromLocalFile(str(there))):
        controller.say(f"no program of this desktop opens {there}; open it by hand")
