"""Small parts that the panels are made of."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QIcon, QPixmap
from PySide6.QtWidgets import (
    QButtonGroup,
    QComboBox,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QSlider,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from palpate.imaging.labels import LABEL_COLOURS
from palpate.ui.desktop.session.controller import Controller


def group(title: str) -> tuple[QGroupBox, QFormLayout]:
    """A titled box with rows of label and control."""
    box = QGroupBox(title)
    form = QFormLayout(box)
    form.setContentsMargins(8, 6, 8, 6)
    form.setVerticalSpacing(5)
    form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
    return box, form


class Panel(QWidget):
    """One titled box. controller : what it shows and acts on. form : the box's rows."""

    def __init__(self, controller: Controller, title: str) -> None:
        super().__init__()
        self._controller = controller
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        box, self.form = group(title)
        column.addWidget(box)


def slider(low: int, high: int, value: int, changed: Callable[[int], None], tip: str) -> QSlider:
    """A horizontal slider."""
    out = QSlider(Qt.Orientation.Horizontal)
    out.setRange(low, high)
    out.setValue(value)
    out.setToolTip(tip)
    out.valueChanged.connect(changed)
    return out


def combo(entries: Iterable[str], chosen: Callable[[str], None], tip: str) -> QComboBox:
    """A list to choose from; only a person's choice is told."""
    out = QComboBox()
    out.addItems(list(entries))
    out.setToolTip(tip)
    out.textActivated.connect(chosen)
    return out


def swatch(label: int) -> QIcon:
    """A square in a label's colour."""
    pixmap = QPixmap(12, 12)
    pixmap.fill(QColor(*LABEL_COLOURS[label][:3]))
    return QIcon(pixmap)


class Choice(QWidget):
    """A row of buttons of which one is pressed. chosen : called with its value."""

    def __init__(self, entries: Sequence[tuple[str, str, str]], chosen: Callable[[str], None]) -> None:
        super().__init__()
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(3)
        self._group = QButtonGroup(self)
        self.buttons: dict[str, QToolButton] = {}
        for value, title, tip in entries:
            button = QToolButton()
            button.setText(title)
            button.setToolTip(tip)
            button.setCheckable(True)
            button.setSizePolicy(button.sizePolicy().Policy.Expanding, button.sizePolicy().Policy.Fixed)
            button.clicked.connect(lambda _=False, v=value: chosen(v))
            self._group.addButton(button)
            row.addWidget(button)
            self.buttons[value] = button

    def select(self, value: str) -> None:
        """Presses one without telling; none where it is not among them."""
        if value in self.buttons:
            self.buttons[value].setChecked(True)
            return
        self._group.setExclusive(False)
        for button in self.buttons.values():
            button.setChecked(False)
        self._group.setExclusive(True)
