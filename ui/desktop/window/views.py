"""How the slice views and the 3D view are arranged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QGridLayout, QWidget

from palpate.imaging.labels import LABELS, ORGAN_LABELS, OUTSIDE
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.crosshair import first_place
from palpate.ui.desktop.slices.slice_picture import BLEND
from palpate.ui.desktop.slices.slice_view import SliceView
from palpate.ui.desktop.slices.slice_viewport import Viewport
from palpate.ui.desktop.solid.solid_view import SolidView
from palpate.ui.pictures.planes import AXIAL, CORONAL, SAGITTAL
from palpate.ui.pictures.planes import PLANES as _PLANES

# Shown around the organ when it is gone to.
_AROUND_MM = 12.0


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
        self._enlarged = 1.0
        self._last: SliceView | None = None
        self._fitted: tuple[bool, bool] | None = None
        self.arrange("rest")

    def visible_slices(self) -> Iterator[SliceView]:
        """The slice views that are shown."""
        return (view for view in self.slices.values() if not view.isHidden())

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what in ("view", "case"):
            self.arrange(self._controller.display.mode)
        if what == "case":
            self._fit_new()
        for view in self.slices.values():
            view.on_change(what)
        self.solid.on_change(what)

    def arrange(self, mode: str) -> None:
        """Four views of one state or of the blend; or three of each state with the 3D view beside them."""
        if mode == self._mode:
            return
        self._mode, self._alone = mode, None
        self.viewport.zoom(1.0 / self._enlarged)
        self._enlarged = 1.0
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
        if alone is None:
            return
        before = min(view.width(), view.height())
        for other in (*self.slices.values(), self.solid):
            if other is not alone:
                other.hide()
        # Rows and columns without a view would keep their share of the room.
        place: tuple[int, int, int, int] = self._grid.getItemPosition(self._grid.indexOf(alone))  # type: ignore[assignment]
        row, column = place[:2]
        for number in range(4):
            self._grid.setColumnStretch(number, int(number == column))
        for number in range(2):
            self._grid.setRowStretch(number, int(number == row))
        self._grid.activate()
        self._alone, self._enlarged = alone, min(view.width(), view.height()) / max(before, 1)
        self.viewport.zoom(self._enlarged)
        self._controller.notify("view")

    def fit(self) -> None:
        """Shows the labels with what is around them, or the whole scan where there are none."""
        labels, ct = self._controller.labels("rest"), self._controller.ct("rest")
        volume = labels if labels is not None else ct
        if volume is not None:
            self._fit(*_reach(volume, [label for label in LABELS if label != OUTSIDE] if labels is not None else ()))

    def go_to_organ(self) -> None:
        """The organ in the middle, the slices through it; the whole scan where no organ is labelled."""
        labels = self._controller.labels("rest")
        if labels is None or not np.isin(labels.array, ORGAN_LABELS).any():
            self.fit()
            return
        low, high = _reach(labels, ORGAN_LABELS)
        place = first_place(labels, None)
        if place is not None and not _holds(labels, self._controller.display.crosshair):
            self._controller.look_at(*place)
        self._fit(low - _AROUND_MM, high + _AROUND_MM)

    def _fit(self, low: np.ndarray, high: np.ndarray) -> None:
        shown = [min(view.width(), view.height()) for view in self.visible_slices()]
        self.viewport.fit(low, high, min(shown, default=min(self.width(), self.height())))
        self._controller.notify("view")

    def through_slices(self, count: int) -> None:
        """Moves through the slices of the view under the pointer, else of the one used last, else of the first."""
        shown = list(self.visible_slices())
        under = [view for view in shown if view.underMouse()]
        focused = [view for view in shown if view.hasFocus()]
        self._last = next(iter([*under, *focused, *(view for view in shown if view is self._last), *shown]), None)
        if self._last is not None:
            self._last.step(0, 0, count)

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


def _holds(labels: Volume, at: tuple[float, float, float]) -> bool:
    """Whether a place, mm, lies in the organ."""
    return int(labels.nearest(np.array([at]))[0]) in ORGAN_LABELS


def _reach(volume: Volume, wanted: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """The box (mm) of the voxels with these labels, or of the whole grid where there are none."""
    shape = np.array(volume.array.shape)
    ends = np.array([[0, 0, 0], shape - 1])
    if wanted:
        inside = np.isin(volume.array, wanted)
        for axis in range(3):
            there = np.flatnonzero(inside.any(axis=tuple(a for a in range(3) if a != axis)))
            if len(there):
                ends[:, axis] = there[0], there[-1]
    points = volume.to_lps(
        np.array([[i, j, k] for i in ends[:, 0] for j in ends[:, 1] for k in ends[:, 2]], dtype=float)
    )
    return points.min(axis=0), points.max(axis=0)
