"""The notice that a long step has ended: the window's entry in the task bar asks for attention, the desktop shows a line."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QMainWindow, QSystemTrayIcon

from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.jobs import JobState

_SHOWN_MS = 10_000
# A step that took less is waited for with the eyes on the window (s).
LONG_S = 20.0


def show_notice(window: QMainWindow, words: str) -> None:
    """Marks the window in the task bar until it is looked at, and shows a line where the desktop has a place for it."""
    if window.isActiveWindow():
        return
    QApplication.alert(window)
    if not (QSystemTrayIcon.isSystemTrayAvailable() and QSystemTrayIcon.supportsMessages()):
        return
    tray = QSystemTrayIcon(window.style().standardIcon(window.style().StandardPixmap.SP_MessageBoxInformation), window)
    tray.messageClicked.connect(window.activateWindow)
    tray.show()
    tray.showMessage("Palpate", words, QSystemTrayIcon.MessageIcon.Information, _SHOWN_MS)
    # The icon is there for the line only.
    QTimer.singleShot(_SHOWN_MS, tray.deleteLater)


class Notices:
    """tell : called once with the words for every job that ended after LONG_S or more, however it ended."""

    def __init__(self, controller: Controller, tell: Callable[[str], None]) -> None:
        self._controller, self._tell = controller, tell
        self._told: JobState | None = None

    def on_change(self, what: str) -> None:
        """Something has changed."""
        job = self._controller.jobs.state
        if what != "job" or job is None or job.running or job is self._told:
            return
        self._told = job
        if job.outcome != "cancelled" and job.seconds_taken is not None and job.seconds_taken >= LONG_S:
            self._tell(f"{job.name}: {job.outcome}" + (f", {job.error}" if job.error else ""))
