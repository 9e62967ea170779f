"""Synthetic mouse and button events: the window gets the same as from a person."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QTabBar, QWidget

from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.ui.desktop.slices.slice_view import SliceView

_LEFT = Qt.MouseButton.LeftButton
Point = tuple[float, float, float]


def click(view: SliceView, at: Point) -> None:
    """Left click at a place, mm, of the slice that a view shows. Raises InputError when it lies outside of the view."""
    QTest.mouseClick(view, _LEFT, Qt.KeyboardModifier.NoModifier, _pixel(view, at))


def drag(view: SliceView, start: Point, end: Point) -> None:
    """Presses, moves in ten steps, lets go."""
    first, last = _pixel(view, start), _pixel(view, end)
    QTest.mousePress(view, _LEFT, Qt.KeyboardModifier.NoModifier, first)
    for step in range(1, 11):
        QTest.mouseMove(view, first + (last - first) * (step / 10.0))
        QTest.qWait(10)
    QTest.mouseRelease(view, _LEFT, Qt.KeyboardModifier.NoModifier, last)


def press(window: QWidget, words: str) -> None:
    """Clicks the visible button that has these words. Raises InputError when there is none or it is off, with its reason."""
    buttons = [b for b in window.findChildren(QAbstractButton) if b.isVisible()]
    found = [b for b in buttons if b.text().strip("0123456789 ").casefold() == words.casefold()]
    if not found and _turned_to(window, words):
        return
    if not found:
        said = ", ".join(sorted({b.text().strip("0123456789 ") for b in buttons if b.text().strip("0123456789 ")}))
        raise InputError(f"no button says {words!r}; there are {said}")
    if not found[0].isEnabled():
        raise InputError(f"the button {words!r} is off: {found[0].toolTip()}")
    QTest.mouseClick(found[0], _LEFT)


def shot(window: QWidget, path: Path) -> Path:
    """The window as it is, in a picture file; whoever waits for the file finds it whole. Raises InputError."""
    with atomic_path(path) as temporary:
        if not window.grab().save(str(temporary)):
            raise InputError(f"{path} cannot be written; choose another place or a name that ends with .png")
    return path


def _turned_to(window: QWidget, words: str) -> bool:
    """Whether a tab that can be seen has these words; it is in front then."""
    for bar in window.findChildren(QTabBar):
        for k in range(bar.count()):
            if bar.isVisible() and bar.tabText(k).casefold() == words.casefold():
                QTest.mouseClick(bar, _LEFT, Qt.KeyboardModifier.NoModifier, bar.tabRect(k).center())
                return True
    return False


def _pixel(view: SliceView, at: Point) -> QPoint:
    plane = view.plane
    pixel = view.screen_map.to_pixel(at[plane.across], at[plane.down]).toPoint()
    if not view.rect().contains(pixel):
        raise InputError(f"that place lies outside of the {plane.name} view; press F to see the whole organ")
    return pixel
