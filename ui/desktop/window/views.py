"""How the slice views and the 3D view are arranged."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QWidget

from palpate.imaging.labels import OUTSIDE
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.slices.slice_picture import BLEND
from palpate.ui.desktop.slices.slice_view import SliceView
from palpate.ui.desktop.slices.slice_viewport import Viewport
from palpate.ui.desktop.solid.solid_view import SolidView
from palpate.ui.pictures.planes import AXIAL, CORONAL, SAGITTAL
from palpate.ui.pictures.planes import PLANES as _PLANES


class Views(QWidget):
    """All views of the case. viewport : where the slices look."""

    def __init__(self, controller: Controller, folder: Path) -> None:
        super().__init__()
        self._controller = controller
        self.viewport = Viewport(np.zeros(3))
        self.slices = {
            (plane.name, state): SliceView(controller, self.viewport, plane, state, self.enlarge)
            for plane in _PLANES
            for state in ("rest", "deformed", BLEND)
        }
        self.solid = SolidView(controller, folder, self.enlarge)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self._grid.setSpacing(2)
        self._mode = ""
        self._alone: QWidget | None = None
        self._fitted: tuple[bool, bool] | None = None
        self.arrange("rest")

    def visible_slices(self) -> Iterator[SliceView]:
        """The slice views that are shown."""
        return (view for view in self.slices.values() if not view.isHidden())

    def told(self, what: str) -> None:
        """Something has changed."""
        if what in ("view", "case"):
            self.arrange(self._controller.display.mode)
        if what == "case":
            self._fit_new()
        for view in self.slices.values():
            view.told(what)
        self.solid.told(what)

    def arrange(self, mode: str) -> None:
        """Four views of one state or of the blend; or three of each state with the 3D view beside them."""
        if mode == self._mode:
            return
        self._mode, self._alone = mode, None
        for view in (*self.slices.values(), self.solid):
            self._grid.removeWidget(view)
            view.hide()
        if mode == "side by side":
            for row, state in enumerate(("rest", "deformed")):
                for column, plane in enumerate((AXIAL, SAGITTAL, CORONAL)):
                    self._put(self.slices[plane.name, state], row, column)
            self._put(self.solid, 0, 3, 2)
            self._stretch(4)
        else:
            for plane, row, column in ((AXIAL, 0, 0), (CORONAL, 1, 0), (SAGITTAL, 1, 1)):
                self._put(self.slices[plane.name, mode], row, column)
            self._put(self.solid, 0, 1)
            self._stretch(2)

    def enlarge(self, view: QWidget) -> None:
        """Shows one view alone, or all again where it was alone."""
        alone = None if self._alone is view else view
        mode, self._mode = self._mode, ""
        self.arrange(mode)
        self._alone = alone
        if alone is not None:
            for other in (*self.slices.values(), self.solid):
                if other is not alone:
                    other.hide()

    def fit(self) -> None:
        """Shows the labels with what is around them, or the whole scan where there are none."""
        labels, ct = self._controller.labels("rest"), self._controller.ct("rest")
        volume = labels if labels is not None else ct
        if volume is None:
            return
        low, high = _reach(volume, labels is not None)
        pixels = min(min(v.width(), v.height()) for v in self.visible_slices())
        self.viewport.fit(low, high, pixels)
        self._controller.notify("view")

    def resizeEvent(self, event: QResizeEvent) -> None:
        """A larger window shows the same, larger."""
        before, now = event.oldSize(), event.size()
        if before.isValid() and min(before.width(), before.height(), now.width(), now.height()) > 0:
            self.viewport.zoom(min(now.width(), now.height()) / min(before.width(), before.height()))

    def _fit_new(self) -> None:
        """The first time there is something to see, and again when labels come."""
        have = (self._controller.ct("rest") is not None, self._controller.labels("rest") is not None)
        if self._controller.case is None and not any(have):
            self._fitted = None
        elif have != self._fitted and any(have):
            self._fitted = have
            self.fit()

    def _put(self, view: QWidget, row: int, column: int, rows: int = 1) -> None:
        self._grid.addWidget(view, row, column, rows, 1)
        view.show()

    def _stretch(self, columns: int) -> None:
        for number in range(4):
            self._grid.setColumnStretch(number, 1 if number < columns else 0)
        for row in range(2):
            self._grid.setRowStretch(row, 1)


def _reach(volume: Volume, labelled: bool) -> tuple[np.ndarray, np.ndarray]:
    """The box (mm) of the labelled voxels, or of the whole grid."""
    shape = np.array(volume.array.shape)
    ends = np.array([[0, 0, 0], shape - 1])
    if labelled:
        inside = volume.array != OUTSIDE
        for axis in range(3):
            there = np.flatnonzero(inside.any(axis=tuple(a for a in range(3) if a != axis)))
            if len(there):
                ends[:, axis] = there[0], there[-1]
    points = volume.to_lps(
        np.array([[i, j, k] for i in ends[:, 0] for j in ends[:, 1] for k in ends[:, 2]], dtype=float)
    )
    return points.min(axis=0), points.max(axis=0)
