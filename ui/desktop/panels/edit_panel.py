"""Tools: look, point at organs, correct labels."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker
from PySide6.QtGui import QColor, QIcon, QPixmap
from PySide6.QtWidgets import QGridLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from palpate.imaging.labels import LABEL_COLOURS, LABELS
from palpate.segmentation.prompts import SEED_NAMES
from palpate.ui.desktop.panels.panel_parts import Choice, combo, group, slider
from palpate.ui.desktop.session.controller import Controller

_TOOLS = (
    ("look", "Look", "Click or drag: move the crosshair"),
    ("seed", "Point", "Click into an organ, where Segment does not find it by itself"),
    ("brush", "Brush", "Paint the chosen label"),
    ("eraser", "Eraser", "Take the chosen label away"),
)


class EditPanel(QWidget):
    """Controls of `Editing`."""

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self._controller = controller
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        box, form = group("Point and correct")
        self.tools = Choice(_TOOLS, lambda tool: controller.show(tool=tool))
        form.addRow(self.tools)
        self.seed = combo(
            SEED_NAMES, lambda name: controller.show(seed_name=name, tool="seed"), "What the click points at"
        )
        form.addRow("Point at", self.seed)
        self.label = combo([], self._choose_label, "What brush and eraser change")
        for value, name in LABELS.items():
            if value:
                self.label.addItem(_swatch(value), name.replace("_", " "), value)
        form.addRow("Label", self.label)
        self.radius = slider(5, 200, 40, lambda v: controller.show(radius_mm=v / 10.0), "Radius of brush and eraser")
        self.radius_words = QLabel()
        form.addRow("Radius", self.radius)
        form.addRow("", self.radius_words)
        self.undo = self._button("Undo", "Ctrl+Z", controller.editing.undo)
        self.redo = self._button("Redo", "Ctrl+Shift+Z", controller.editing.redo)
        self.save = self._button("Save", "Ctrl+S", controller.save)
        self.forget = self._button("Forget points", "", controller.editing.forget_seeds)
        grid = QGridLayout()
        for number, button in enumerate((self.undo, self.redo, self.save, self.forget)):
            grid.addWidget(button, number // 2, number % 2)
        form.addRow(grid)
        column.addWidget(box)

    def _button(self, title: str, shortcut: str, act: object) -> QPushButton:
        out = QPushButton(title)
        if shortcut:
            out.setShortcut(shortcut)
        out.clicked.connect(lambda: act())  # type: ignore[operator]
        return out

    def _choose_label(self, _: str) -> None:
        tool = self._controller.display.tool
        self._controller.show(label=int(self.label.currentData()), tool=tool if tool == "eraser" else "brush")

    def told(self, what: str) -> None:
        """Something has changed."""
        if what not in ("case", "labels", "tools", "view", "job"):
            return
        controller, display = self._controller, self._controller.display
        reason = controller.editing.why_not()
        self.tools.select(display.tool)
        self.seed.setCurrentText(display.seed_name)
        self.label.setCurrentIndex(self.label.findData(display.label))
        with QSignalBlocker(self.radius):
            self.radius.setValue(round(10 * display.radius_mm))
        self.radius_words.setText(f"{display.radius_mm:.1f} mm")
        for name in ("brush", "eraser"):
            self.tools.buttons[name].setEnabled(not reason)
            self.tools.buttons[name].setToolTip(reason.capitalize() or {t[0]: t[2] for t in _TOOLS}[name])
        strokes = None if controller.case is None or reason else controller.case.corrections
        can_undo, can_redo, unsaved = (
            (False,) * 3 if strokes is None else (strokes.can_undo, strokes.can_redo, strokes.unsaved)
        )
        self._state(self.undo, can_undo, "Take the last correction back", reason or "nothing to undo")
        self._state(self.redo, can_redo, "Make it again", reason or "nothing to redo")
        self._state(self.save, unsaved, "Write the corrected labels", reason or "nothing unsaved")
        seeds = controller.case is not None and any(controller.case.seeds.values())
        self._state(self.forget, seeds, "Take all points away", "no points yet")

    def _state(self, button: QPushButton, possible: bool, tip: str, reason: str) -> None:
        button.setEnabled(possible)
        button.setToolTip(tip if possible else reason.capitalize())


def _swatch(label: int) -> QIcon:
    pixmap = QPixmap(12, 12)
    pixmap.fill(QColor(*LABEL_COLOURS[label][:3]))
    return QIcon(pixmap)
