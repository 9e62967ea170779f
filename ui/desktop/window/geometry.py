"""Size and place of the window: fitted to the screen the first time, as a person left it after that."""

from __future__ import annotations

import contextlib
from pathlib import Path

from PySide6.QtCore import QByteArray, QSize
from PySide6.QtGui import QGuiApplication
from PySide6.QtWidgets import QMainWindow

from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.ui.desktop.session.recent import settings_folder

WANTED = QSize(1500, 940)
# Part of the screen's free area; the rest is for the window's own frame.
_MOST = 0.95
_FILE = "window_geometry"


def first_size(free: QSize) -> QSize:
    """Of a window that has no size yet, on a screen with so much room beside panels and docks, in pixels."""
    return QSize(min(WANTED.width(), int(_MOST * free.width())), min(WANTED.height(), int(_MOST * free.height())))


def fit(window: QMainWindow) -> None:
    """Gives the window its first size."""
    screen = QGuiApplication.primaryScreen()
    without = screen is None or QGuiApplication.platformName() == "offscreen"
    window.resize(WANTED if without else first_size(screen.availableGeometry().size()))


def restore(window: QMainWindow) -> None:
    """Puts the window where it was; Qt moves one whose screen is gone onto one that is there."""
    with contextlib.suppress(OSError):
        window.restoreGeometry(QByteArray(_path().read_bytes()))


def remember(window: QMainWindow) -> None:
    """Notes size and place. A settings folder that cannot be written is no reason to stop."""
    with contextlib.suppress(InputError), atomic_path(_path()) as temporary:
        temporary.write_bytes(window.saveGeometry().data())


def _path() -> Path:
    return settings_folder() / _FILE
