"""Starts the window."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from palpate.core.errors import InputError
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


def qt_application(headless: bool) -> QApplication:
    """The one QApplication, dressed; without a screen where headless. `display_server.check` says beforehand whether it can be."""
    if headless:
        os.environ["QT_QPA_PLATFORM"] = "offscreen"
    from PySide6.QtCore import qInstallMessageHandler
    from PySide6.QtWidgets import QApplication  # here, because the platform is chosen before

    from palpate.ui.desktop.style import dress

    if headless:
        qInstallMessageHandler(told_by_qt)
    application = QApplication.instance() or QApplication(sys.argv[:1])
    assert isinstance(application, QApplication)
    application.setApplicationName("Palpate")
    dress(application)
    return application


def events_for(application: QApplication) -> Callable[[float], None]:
    """What lets the windows' events be handled for so many seconds."""

    def process(seconds: float) -> None:
        end = time.monotonic() + seconds
        while True:
            application.processEvents()
            if time.monotonic() >= end:
                return
            time.sleep(0.001)

    return process


def told_by_qt(kind: object, context: object, message: str) -> None:
    """Qt's words go to standard error, but for what it says of every window that has no screen."""
    if "propagateSizeHints" not in message:
        sys.stderr.write(f"{message}\n")
