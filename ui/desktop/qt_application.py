"""The one QApplication of a process, dressed; with a screen or without."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication


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
