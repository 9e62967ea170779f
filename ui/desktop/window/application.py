"""Starts the window."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from palpate.core.errors import InputError
from palpate.ui.desktop.qt_application import qt_application
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.window import display_server

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication

    from palpate.ui.desktop.window.main_window import MainWindow


class Shown(TypedDict):
    """Of a window that a person used."""

    longest_stall_ms: float


def show(case: Path | None, headless: bool = False) -> Shown:
    """Opens the window and returns when it is closed: the longest stall in ms. Raises InputError when it cannot be opened."""
    window, application = new_window(headless)
    from palpate.ui.desktop.window import geometry  # here, because the platform is chosen before

    if case is not None:
        window.page.open_case(case)
        if window.controller.case is None:
            reason = window.page.problem.text()
            window.shut()
            raise InputError(reason)
    geometry.restore(window)
    window.show()
    ended = signal.signal(signal.SIGTERM, lambda *_: application.quit())
    interrupted = signal.signal(signal.SIGINT, lambda *_: application.quit())
    try:
        application.exec()
    finally:
        signal.signal(signal.SIGTERM, ended)
        signal.signal(signal.SIGINT, interrupted)
        geometry.remember(window)
        longest = round(window.responsiveness.longest_ms, 1)
        if window.controller.listeners:  # ended by a signal rather than by the window's own button
            window.shut()
    return {"longest_stall_ms": longest}


def new_window(headless: bool) -> tuple[MainWindow, QApplication]:
    """The window, not shown yet, and the QApplication. Raises InputError when no window can be opened."""
    display_server.check(headless)
    application = qt_application(headless)
    from palpate.ui.desktop.window.main_window import MainWindow  # here, because the platform is chosen before

    return MainWindow(Controller()), application
