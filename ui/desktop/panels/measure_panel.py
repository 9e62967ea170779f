"""Measuring: regions of the stiffness map, distances and angles, kept with the case, and what they measure."""

from __future__ import annotations

from html import escape

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QListWidget, QListWidgetItem, QPushButton

from palpate.case.measured.measurements import REGIONS
from palpate.ui.desktop import style
from palpate.ui.desktop.panels.panel_parts import Choice, Panel
from palpate.ui.desktop.session.controller import Controller

_ON_MAP = (
    ("look", "Look", "Click or drag: move the crosshair (1)"),
    ("ellipse", "Ellipse", "Drag from corner to corner: mean stiffness within an ellipse (E)"),
    ("region", "Free region", "Drag around a part of the organ: mean stiffness within (R)"),
)
_ON_SCAN = (
    ("ruler", "Ruler", "Drag: a distance in mm (6)"),
    ("angle", "Angle", "Three clicks: an end, the vertex, the other end (7)"),
)
# Tools of this tab: who leaves it leaves them.
MEASURES = (*REGIONS, "ruler", "angle")
_NOTE = (
    "Mean of the map over the part of a region that the scans determine, with its 95 % interval. The map is smoothed: quote "
    "the half. Measurements are kept with the case; regions are printed in the report and the DICOM SR."
)


class MeasurePanel(Panel):
    """Controls of `Measuring`."""

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller, "Measure")
        form = self.form
        self.on_map = Choice(_ON_MAP, lambda tool: controller.show(tool=tool))
        self.on_scan = Choice(_ON_SCAN, lambda tool: controller.show(tool=tool))
        form.addRow(self.on_map)
        form.addRow(self.on_scan)
        self.list = QListWidget()
        self.list.setWordWrap(True)
        self.list.setMinimumHeight(150)
        self.list.setAccessibleName("measurements")
        self.delete = QPushButton("Delete")
        self.list.itemClicked.connect(lambda item: self._go_to(item.data(Qt.ItemDataRole.UserRole)))
        self.list.currentRowChanged.connect(lambda row: self.delete.setEnabled(row >= 0))
        form.addRow(self.list)
        self.delete.setToolTip("Take the chosen measurement away")
        self.delete.clicked.connect(self._delete)
        row = QHBoxLayout()
        row.addWidget(self.delete)
        row.addStretch(1)
        form.addRow(row)
        note = QLabel(f"<span style='color:{style.FAINT}'>{escape(_NOTE)}</span>")
        note.setWordWrap(True)
        form.addRow(note)

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what in ("case", "view", "tools"):
            self.on_map.select(self._controller.display.tool)
            self.on_scan.select(self._controller.display.tool)
        if what in ("case", "labels", "measured", "steps"):
            self._fill()

    def _fill(self) -> None:
        measuring, row = self._controller.measuring, self.list.currentRow()
        for kind in REGIONS:
            reason = measuring.why_not(kind, "rest")
            self.on_map.buttons[kind].setEnabled(not reason)
            tip = {name: tip for name, _, tip in _ON_MAP}[kind]
            self.on_map.buttons[kind].setToolTip(reason.capitalize() or tip)
        self.list.clear()
        for one in measuring.kept:
            words = f"{one.name}  {one.kind}, {one.plane}: {', '.join(measuring.value_words(one))}"
            item = QListWidgetItem(words)
            item.setData(Qt.ItemDataRole.UserRole, one.name)
            self.list.addItem(item)
        self.list.setCurrentRow(min(row, self.list.count() - 1))
        self.delete.setEnabled(self.list.currentRow() >= 0)

    def _go_to(self, name: str) -> None:
        """Shows the slice of a measurement."""
        found = [one for one in self._controller.measuring.kept if one.name == name]
        if found:
            self._controller.look_at(*(float(x) for x in np.mean(found[0].points, axis=0)))

    def _delete(self) -> None:
        item = self.list.currentItem()
        if item is not None:
            self._controller.measuring.remove(item.data(Qt.ItemDataRole.UserRole))
