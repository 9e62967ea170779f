"""What a desktop does to tell a person who looks elsewhere."""

from __future__ import annotations

from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication, QMainWindow, QSystemTrayIcon

_SHOWN_MS = 10_000


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
