"""One slice view: shows its picture, and turns mouse and wheel into calls of the controller."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QPointF, QSize, Qt
from PySide6.QtGui import QColor, QMouseEvent, QPainter, QPaintEvent, QPen, QWheelEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from palpate.core.errors import InputError
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.slices.slice_picture import SlicePicture
from palpate.ui.desktop.slices.slice_viewport import Screen, Viewport
from palpate.ui.pictures.planes import Plane

_LEFT, _RIGHT, _MIDDLE = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton, Qt.MouseButton.MiddleButton


class SliceView(QWidget):
    """plane : which. state : "rest", "deformed", or "blend" for one over the other. viewport : shared by all views."""

    def __init__(self, controller: Controller, viewport: Viewport, plane: Plane, state: str) -> None:
        super().__init__()
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

    def told(self, what: str) -> None:
        """Something has changed."""
        if what in ("case", "labels"):
            self._picture.labels_version += 1
        if what in ("case", "labels", "view", "tools", "results"):
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor("black"))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        screen = self.screen_map
        self._picture.paint(painter, screen, self.position)
        if self.controller.display.tool in ("brush", "eraser") and self._mouse is not None:
            painter.setPen(QPen(QColor("white"), 1.2))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            radius = self.controller.display.radius_mm / self.viewport.mm_per_pixel
            painter.drawEllipse(self._mouse, radius, radius)
        painter.end()

    # Mouse

    def mousePressEvent(self, event: QMouseEvent) -> None:
        point = self.screen_map.point(event.position(), self.controller.display.crosshair)
        shift = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
        tool = self.controller.display.tool
        self._pressed = (event.button(), event.position(), "pan" if shift or event.button() == _MIDDLE else tool)
        if event.button() != _LEFT or shift:
            return
        try:
            if tool == "seed":
                self.controller.editing.seed(self.editing_state, self.controller.display.seed_name, point)
            elif tool in ("brush", "eraser"):
                self.controller.editing.begin(self.editing_state, self.plane, point)
            else:
                self.controller.look_at(*point)
        except InputError as error:
            self._pressed = None
            self.controller.say(str(error))

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        self._mouse = event.position()
        if self._pressed is None:
            if self.controller.display.tool in ("brush", "eraser"):
                self.update()
            return
        button, last, act = self._pressed
        moved = event.position() - last
        if button == _RIGHT:
            window = self.controller.display.window.moved(2.0 * moved.y(), 2.0 * moved.x())
            self.controller.show(centre=window.centre, width=window.width)
        elif act == "pan":
            self.viewport.centre[self.plane.across] -= moved.x() * self.viewport.mm_per_pixel
            self.viewport.centre[self.plane.down] -= self.plane.down_sign * moved.y() * self.viewport.mm_per_pixel
            self.controller.notify("view")
        else:
            point = self.screen_map.point(event.position(), self.controller.display.crosshair)
            if act in ("brush", "eraser"):
                self.controller.editing.go_on(self.plane, point)
            elif act == "look":
                self.controller.look_at(*point)
        self._pressed = (button, event.position(), act)

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._pressed is not None and self._pressed[2] in ("brush", "eraser"):
            self.controller.editing.end()
        self._pressed = None

    def leaveEvent(self, event: QEvent) -> None:
        self._mouse = None
        self.update()

    def wheelEvent(self, event: QWheelEvent) -> None:
        turns = event.angleDelta().y() / 120.0
        if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            self.viewport.zoom(1.15**turns)
            self.controller.notify("view")
        else:
            self.scroll_slices(turns)

    def scroll_slices(self, count: float) -> None:
        """Moves through the scan by so many slices, towards the head, the left or the back."""
        state = self.editing_state
        volume = self.controller.ct(state)
        volume = self.controller.labels(state) if volume is None else volume
        if volume is not None:
            at = list(self.controller.display.crosshair)
            at[self.plane.normal] += count * float(volume.spacing[self.plane.normal])
            self.controller.look_at(*at)
