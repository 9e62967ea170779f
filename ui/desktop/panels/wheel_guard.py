"""The wheel over the side panel scrolls the panel: it changes a control only where a person has put the focus into it."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QAbstractSlider, QAbstractSpinBox, QComboBox, QScrollBar, QTabBar, QWidget


class WheelGuard(QObject):
    """Guards all controls that lie in a panel when it is made. Tabs never turn by the wheel."""

    def __init__(self, panel: QWidget) -> None:
        super().__init__(panel)
        for kind in (QComboBox, QAbstractSpinBox, QAbstractSlider, QTabBar):
            for control in panel.findChildren(kind):
                if not isinstance(control, QScrollBar):
                    self._guard(control)

    def _guard(self, control: QWidget) -> None:
        # The wheel itself must not bring the focus.
        if control.focusPolicy() == Qt.FocusPolicy.WheelFocus:
            control.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        control.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() != QEvent.Type.Wheel or not isinstance(watched, QWidget):
            return False
        if watched.hasFocus() and not isinstance(watched, QTabBar):
            return False
        event.ignore()  # it goes to what lies around: the panel scrolls
        return True
