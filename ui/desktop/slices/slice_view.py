"""One slice view: shows its picture, and turns mouse, wheel and keys into calls of the controller.

The habits of 3D Slicer and ITK-SNAP: the left button does what the chosen tool does, the right one magnifies, the middle one (or
shift) moves the picture, the wheel goes through the slices; arrows and Page Up and Down move the crosshair by voxels.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QSize, Qt
from PySide6.QtGui import QColor, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QWheelEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from palpate.core.errors import InputError
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.drawing import SHAPES
from palpate.ui.desktop.slices.slice_picture import SlicePicture
from palpate.ui.desktop.slices.slice_viewport import Screen, Viewport
from palpate.ui.pictures.planes import Plane

_LEFT, _RIGHT, _MIDDLE = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton, Qt.MouseButton.MiddleButton
_DRAWS = ("brush", "eraser")
# Tools by which a double click would do nothing else: those that look, and those that measure by a drag.
_ENLARGES = ("look", "window", "ruler", "ellipse", "region")
# Right drag: pixels up that double the magnification. Window tool: HU a pixel.
DOUBLES_PIXELS, _HU_PIXEL = 120.0, 2.0
# Voxels across and down the screen, and slices, that a key moves the crosshair by; five times that with shift.
_KEYS = {
    Qt.Key.Key_Left: (-1, 0, 0), Qt.Key.Key_Right: (1, 0, 0), Qt.Key.Key_Up: (0, -1, 0), Qt.Key.Key_Down: (0, 1, 0),
    Qt.Key.Key_PageUp: (0, 0, 1), Qt.Key.Key_PageDown: (0, 0, -1),
}  # fmt: skip
_SHIFTED = 5


class SliceView(QWidget):
    """plane : which. state : "rest", "deformed", or "blend" for one over the other. viewport : shared by all views. enlarge : what
    a double click does."""

    def __init__(
        self, controller: Controller, viewport: Viewport, plane: Plane, state: str,
        enlarge: Callable[[QWidget], None] = lambda view: None,
    ) -> None:  # fmt: skip
        super().__init__()
        self._enlarge = enlarge
        self.controller, self.viewport, self.plane, self.state = controller, viewport, plane, state
        self._picture = SlicePicture(controller, plane, state)
        self._pressed: tuple[Qt.MouseButton, QPointF, str] | None = None
        self._mouse: QPointF | None = None
        self.setMouseTracking(True)
        self.setMinimumSize(QSize(88, 140))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Expanding)
        self.setFocusPolicy(Qt.FocusPolicy.WheelFocus)
        self.setAccessibleName(f"{plane.name} {state}")

    @property
    def editing_state(self) -> str:
        """The scan that a click belongs to: in a blend the one at rest."""
        return "deformed" if self.state == "deformed" else "rest"

    @property
    def screen_map(self) -> Screen:
        """Pixels to millimetres, as the view is now."""
        return Screen(self.plane, self.viewport, self.size())

    @property
    def position(self) -> float:
        """Of the slice along its normal, mm."""
        return self.controller.display.crosshair[self.plane.normal]

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what in ("case", "labels"):
            self._picture.labels_version += 1
        if what in ("case", "labels", "view", "tools", "results", "measured", "drawn", "steps"):
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor("black"))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        screen = self.screen_map
        self._picture.paint(painter, screen, self.position)
        if self.controller.display.tool in _DRAWS and self._mouse is not None:
            painter.setPen(QPen(QColor("white"), 1.2))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            radius = self.controller.display.radius_mm / self.viewport.mm_per_pixel
            painter.drawEllipse(self._mouse, radius, radius)
        painter.end()

    # Mouse

    def mousePressEvent(self, event: QMouseEvent) -> None:
        act = self._act(event)
        self._pressed = (event.button(), event.position(), act)
        if act in ("pan", "zoom", "window"):
            return
        point = self.screen_map.point(event.position(), self.controller.display.crosshair)
        erase = bool(event.modifiers() & Qt.KeyboardModifier.ControlModifier)
        self._try(lambda: self._begin(act, point, erase))

    def _act(self, event: QMouseEvent) -> str:
        """What a button does: the tool's name, or "pan", "zoom"."""
        if event.button() == _MIDDLE or event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            return "pan"
        return "zoom" if event.button() == _RIGHT else self.controller.display.tool

    def _begin(self, act: str, point: tuple[float, float, float], erase: bool) -> None:
        controller, display = self.controller, self.controller.display
        if act == "seed":
            controller.editing.seed(self.editing_state, display.seed_name, point)
        elif act in _DRAWS:
            controller.editing.begin(self.editing_state, None if display.ball else self.plane, point, erase)
        elif act in SHAPES:
            controller.drawing.press(act, self.editing_state, self.plane, point, erase)
        else:
            controller.look_at(*point)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._mouse = event.position()
        if self._pressed is None:
            if self.controller.display.tool in _DRAWS:
                self.update()
            return
        button, last, act = self._pressed
        self._pressed = (button, event.position(), act)
        self._drag(act, event.position() - last, event.position())

    def _drag(self, act: str, moved: QPointF, now: QPointF) -> None:
        controller, display = self.controller, self.controller.display
        point = self.screen_map.point(now, display.crosshair)
        if act == "window":
            window = display.window.moved(_HU_PIXEL * moved.y(), _HU_PIXEL * moved.x())
            controller.show(centre=window.centre, width=window.width)
        elif act == "zoom":
            self.viewport.zoom(2.0 ** (-moved.y() / DOUBLES_PIXELS))
            controller.notify("view")
        elif act == "pan":
            self.viewport.centre[self.plane.across] -= moved.x() * self.viewport.mm_per_pixel
            self.viewport.centre[self.plane.down] -= self.plane.down_sign * moved.y() * self.viewport.mm_per_pixel
            controller.notify("view")
        elif act in _DRAWS:
            controller.editing.go_on(None if display.ball else self.plane, point)
        elif act in SHAPES:
            controller.drawing.move(point)
        elif act == "look":
            controller.look_at(*point)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        pressed, self._pressed = self._pressed, None
        if pressed is not None and pressed[2] in _DRAWS:
            self.controller.editing.end()
        elif pressed is not None and pressed[2] in SHAPES:
            self._try(self.controller.drawing.release)

    def _try(self, act: Callable[[], None]) -> None:
        try:
            act()
        except InputError as error:
            self._pressed = None
            self.controller.say(str(error))

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == _LEFT and self.controller.display.tool in _ENLARGES:
            self._pressed = None
            self._enlarge(self)
        elif event.button() == _LEFT and self.controller.display.tool == "polygon":
            self._try(self.controller.drawing.close)
        else:
            self.mousePressEvent(event)

    def leaveEvent(self, event: QEvent) -> None:
        self._mouse = None
        self.update()

    def wheelEvent(self, event: QWheelEvent) -> None:
        turns = event.angleDelta().y() / 120.0
        if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            self.viewport.zoom(1.15**turns)
            self.controller.notify("view")
        else:
            self.step(0, 0, turns)

    # Keys

    def keyPressEvent(self, event: QKeyEvent) -> None:
        move = _KEYS.get(Qt.Key(event.key()))
        if move is None:
            super().keyPressEvent(event)
            return
        times = _SHIFTED if event.modifiers() & Qt.KeyboardModifier.ShiftModifier else 1
        self.step(*(times * voxels for voxels in move))

    def step(self, across: float, down: float, slices: float) -> None:
        """Moves the crosshair by voxels of the scan across and down the screen, and through the slices: towards the head, the
        left or the back."""
        state = self.editing_state
        volume = self.controller.ct(state)
        volume = self.controller.labels(state) if volume is None else volume
        if volume is not None:
            plane, at = self.plane, np.array(self.controller.display.crosshair)
            for axis, count in ((plane.across, across), (plane.down, plane.down_sign * down), (plane.normal, slices)):
                at[axis] += count * float(volume.spacing[axis])
            self.controller.look_at(*at.tolist())
