"""A row for each label: whether it is seen, and how much of it is seen through."""

from __future__ import annotations

from functools import partial

from PySide6.QtCore import QSignalBlocker
from PySide6.QtWidgets import QCheckBox, QGridLayout, QGroupBox, QSlider

from palpate.imaging.labels import BLADDER, BONE, LABELS, ORGAN_LABELS, RECTUM
from palpate.ui.desktop.panels.panel_parts import slider, swatch
from palpate.ui.desktop.session.controller import Controller

_LISTED = (*ORGAN_LABELS, BLADDER, RECTUM, BONE)


class LabelRows(QGroupBox):
    """Controls of `Display.label_opacity`. shown, shares : by label."""

    def __init__(self, controller: Controller) -> None:
        super().__init__("Labels")
        self._controller = controller
        grid = QGridLayout(self)
        grid.setContentsMargins(8, 6, 8, 6)
        grid.setVerticalSpacing(2)
        self.shown: dict[int, QCheckBox] = {}
        self.shares: dict[int, QSlider] = {}
        # What a label that is hidden had before.
        self._before: dict[int, float] = {}
        for row, label in enumerate(_LISTED):
            words = LABELS[label].replace("_", " ")
            box = QCheckBox(words)
            box.setIcon(swatch(label))
            box.setToolTip(f"Whether {words} is seen, with its outline")
            box.toggled.connect(partial(self._show, label))
            share = slider(0, 100, 100, partial(self._percent, label), f"Opacity of {words}")
            grid.addWidget(box, row, 0)
            grid.addWidget(share, row, 1)
            self.shown[label], self.shares[label] = box, share
        self.refresh()

    def refresh(self) -> None:
        """Shows how it is."""
        for label in _LISTED:
            share = self._controller.display.opacity_of(label)
            with QSignalBlocker(self.shown[label]), QSignalBlocker(self.shares[label]):
                self.shown[label].setChecked(share > 0.0)
                self.shares[label].setValue(round(100.0 * share))

    def _show(self, label: int, on: bool) -> None:
        if not on:
            self._before[label] = self._controller.display.opacity_of(label)
        self._set(label, self._before.get(label, 1.0) if on else 0.0)

    def _percent(self, label: int, value: int) -> None:
        self._set(label, value / 100.0)

    def _set(self, label: int, share: float) -> None:
        self._controller.show(label_opacity={**self._controller.display.label_opacity, label: share})
