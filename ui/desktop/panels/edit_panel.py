"""Tools: look, point at organs, correct labels."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFormLayout,
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QSpinBox,
)

from palpate.imaging.labels import LABELS
from palpate.segmentation.prompts import SEED_NAMES
from palpate.ui.desktop.panels.panel_parts import Choice, Panel, combo, slider, swatch
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.display import PAINTS

_TOOLS = (
    ("look", "Look", "Click or drag: move the crosshair (1)"),
    ("seed", "Point", "Click into an organ, where Segment does not find it by itself (2)"),
    ("brush", "Brush", "Paint the chosen label; with Ctrl, take it away (3)"),
    ("eraser", "Eraser", "Take the chosen label away (4)"),
)
_OUTLINED = (
    ("lasso", "Lasso", "Drag around what the chosen label shall have; with Ctrl, what it shall lose (8)"),
    (
        "polygon",
        "Polygon",
        "Click the corners, double click ends; with Ctrl at the first, what the label shall lose (9)",
    ),
)
# Tools of this tab: who leaves it leaves them.
EDITS = ("seed", "brush", "eraser", "lasso", "polygon")
# Title, operation, tip, and row, column and columns of the button.
_OPERATIONS = (
    ("Fill between slices", "fill between slices", "Draw the axial slices that lie between drawn ones", 0, 0, 3),
    ("Smooth", "smooth", "Take steps and spikes of the label away", 1, 0, 1),
    (
        "Keep largest piece",
        "keep the largest piece",
        "Take away the pieces that are apart from the largest one",
        1,
        1,
        2,
    ),
    ("Grow", "grow", "By the distance beside; never into another organ", 2, 0, 1),
    ("Shrink", "shrink", "By the distance beside", 2, 1, 1),
)
_MOST_MM = 20.0
_NO_HU = -1025  # below what a CT holds: no limit


class EditPanel(Panel):
    """Controls of `Editing`."""

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller, "Point and correct")
        form = self.form
        self.tools = Choice(_TOOLS, lambda tool: controller.show(tool=tool))
        form.addRow(self.tools)
        self.outlined = Choice(_OUTLINED, lambda tool: controller.show(tool=tool))
        form.addRow(self.outlined)
        self._add_brush()
        self.operations = self._operations(form)
        self.undo = self._button("Undo", "Ctrl+Z", controller.editing.undo)
        self.redo = self._button("Redo", "Ctrl+Shift+Z", controller.editing.redo)
        self.save = self._button("Save", "Ctrl+S", controller.save)
        self.forget = self._button("Forget points", "", controller.editing.forget_seeds)
        grid = QGridLayout()
        for number, button in enumerate((self.undo, self.redo, self.save, self.forget)):
            grid.addWidget(button, number // 2, number % 2)
        form.addRow(grid)

    def _add_brush(self) -> None:
        """What is pointed at or painted, and how wide."""
        controller, form = self._controller, self.form
        self.seed = combo(
            SEED_NAMES, lambda name: controller.show(seed_name=name, tool="seed"), "What the click points at"
        )
        form.addRow("Point at", self.seed)
        self.label = combo([], self._choose_label, "What brush, eraser, lasso and polygon change")
        for value, name in LABELS.items():
            if value:
                self.label.addItem(swatch(value), name.replace("_", " "), value)
        form.addRow("Label", self.label)
        self.radius = slider(
            5,
            200,
            40,
            lambda v: controller.show(radius_mm=v / 10.0),
            "Radius of brush and eraser (keys + and \N{MINUS SIGN})",
        )
        self.radius_words = QLabel()
        form.addRow("Radius", self.radius)
        self.ball = QCheckBox("in 3D")
        self.ball.setToolTip("A ball instead of a disc in the slice")
        self.ball.toggled.connect(lambda on: controller.show(ball=on))
        row = QHBoxLayout()
        row.addWidget(self.radius_words)
        row.addWidget(self.ball)
        form.addRow("", row)
        self.low, self.high = self._limit(), self._limit()
        limits = QHBoxLayout()
        for part in (self.low, QLabel("to"), self.high):
            limits.addWidget(part)
        form.addRow("Only HU", limits)

    def _limit(self) -> QSpinBox:
        out = QSpinBox()
        out.setRange(_NO_HU, 3071)
        out.setSpecialValueText("any")
        out.setValue(_NO_HU)
        out.setToolTip("Threshold of the brush: only voxels whose CT lies between are changed")
        out.valueChanged.connect(self._choose_limits)
        return out

    def _choose_limits(self) -> None:
        low, high = (None if spin.value() == _NO_HU else float(spin.value()) for spin in (self.low, self.high))
        self._controller.show(paint_low_hu=low, paint_high_hu=high)

    def _operations(self, form: QFormLayout) -> list[QPushButton]:
        """Buttons that change the whole label, and by how much it grows or shrinks."""
        self.amount = QDoubleSpinBox()
        self.amount.setRange(0.5, _MOST_MM)
        self.amount.setValue(1.0)
        self.amount.setSingleStep(0.5)
        self.amount.setSuffix(" mm")
        grid, buttons = QGridLayout(), []
        for title, name, tip, line, column, columns in _OPERATIONS:
            button = QPushButton(title)
            button.setToolTip(tip)
            button.clicked.connect(lambda _=False, n=name: self._apply(n))
            grid.addWidget(button, line, column, 1, columns)
            buttons.append(button)
        grid.addWidget(self.amount, 2, 2)
        form.addRow(grid)
        return buttons

    def _apply(self, operation: str) -> None:
        state = "deformed" if self._controller.display.mode == "deformed" else "rest"
        amount = self.amount.value() if operation in ("grow", "shrink") else 0.0
        self._controller.attempt(lambda: self._controller.editing.apply(state, operation, amount))

    def _button(self, title: str, shortcut: str, act: object) -> QPushButton:
        out = QPushButton(title)
        if shortcut:
            out.setShortcut(shortcut)
        out.clicked.connect(lambda: act())  # type: ignore[operator]
        return out

    def _choose_label(self, _: str) -> None:
        # The tool stays: a label that is chosen by mistake must not make the next click paint.
        self._controller.show(label=int(self.label.currentData()))

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what not in ("case", "labels", "tools", "view", "job"):
            return
        controller, display = self._controller, self._controller.display
        reason = controller.editing.why_not()
        self.tools.select(display.tool)
        self.outlined.select(display.tool)
        with QSignalBlocker(self.ball):
            self.ball.setChecked(display.ball)
        for button in self.operations:
            button.setEnabled(not reason)
        self.seed.setCurrentText(display.seed_name)
        self.label.setCurrentIndex(self.label.findData(display.label))
        with QSignalBlocker(self.radius):
            self.radius.setValue(round(10 * display.radius_mm))
        self.radius_words.setText(f"{display.radius_mm:.1f} mm")
        tips = {name: tip for name, _, tip in (*_TOOLS, *_OUTLINED)}
        for name, tool in (*self.tools.buttons.items(), *self.outlined.buttons.items()):
            if name in PAINTS:
                tool.setEnabled(not reason)
                tool.setToolTip(reason.capitalize() or tips[name])
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
