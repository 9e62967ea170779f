"""The organ under the probe: shows the drawing process' pictures, and turns the mouse into pressing, pulling, sliding and looking."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QImage, QMouseEvent, QPaintEvent, QResizeEvent, QWheelEvent
from PySide6.QtWidgets import QWidget

from palpate.applications.touch.window.model import TouchModel
from palpate.core.arrays import FloatArray
from palpate.ui.desktop import style
from palpate.ui.desktop.slices.slice_marks import text
from palpate.ui.desktop.solid.camera import Camera, first_hit
from palpate.ui.desktop.solid.solid_marks import begun, directions, image_of

# Down by so many pixels is a millimetre deeper; across, the probe slides only once it has gone farther than this.
PIXELS_PER_MM, _STICKS = 25.0, 14.0
_HELP = "left button: press the organ, down deeper, up pulls, sideways slides    right button: turn    wheel: magnify"


class TouchView(QWidget):
    """camera : how the organ is seen. model : what is known."""

    def __init__(self, model: TouchModel) -> None:
        super().__init__()
        self.model = model
        centre = model.rest.mean(axis=0)
        half = 1.35 * float(np.linalg.norm(model.rest - centre, axis=1).max())
        self.camera = Camera(15.0, 20.0, 1.0, centre, half)
        self._image: QImage | None = None
        self._asked = self._drawn = 0
        self._stale = True
        self._pressed: tuple[QPointF, FloatArray] | None = None
        self._turning: QPointF | None = None
        self._hover: FloatArray | None = None
        self.setMinimumSize(QSize(320, 320))
        self.setMouseTracking(True)
        self.setAccessibleName("organ under the probe")

    @property
    def settled(self) -> bool:
        """Whether the picture shows the organ as it is, or none can be drawn."""
        return self.model.drawing.over or not (self._stale or self._drawn < self._asked or self.model.busy)

    def tick(self) -> None:
        """Takes a picture that has come, and asks for the next where it is needed."""
        for reply in self.model.drawing.replies():
            self._drawn, self._image = reply.head["id"], image_of(reply)
            self.update()
        if self._stale and self._drawn >= self._asked and self.isVisible() and not self.model.drawing.over:
            self._ask()

    def touch_changed(self) -> None:
        """The organ or the probe has moved."""
        self._stale = True

    def turn(self, azimuth: float, elevation: float, zoom: float | None = None) -> None:
        """Looks from there, degrees."""
        c = self.camera
        self.camera = Camera(azimuth, float(np.clip(elevation, -89.0, 89.0)), zoom or c.zoom, c.centre, c.half)
        self._stale = True

    def pixel(self, point: FloatArray) -> tuple[float, float]:
        """Where a point (3,) mm is seen."""
        return self.camera.pixel(point, self.width(), self.height())

    def place(self, at: QPointF) -> FloatArray | None:
        """The point (3,) of the organ at rest that is seen under a pixel, mm; None beside the organ."""
        origin, direction = self.camera.ray(at.x(), at.y(), self.width(), self.height())
        found = first_hit(self.model.rest + self.model.u, self.model.faces, origin, direction)
        return None if found is None else found[1] @ self.model.rest[self.model.faces[found[0]]]

    def _ask(self) -> None:
        self._asked += 1
        self._stale = False
        ratio = self.devicePixelRatioF()
        where = self.model.position()
        if where is None and self._hover is not None:
            where = self._just_above(self._hover), False
        c = self.camera
        self.model.drawing.say(
            type="view", id=self._asked, size=[max(64, int(self.width() * ratio)), max(64, int(self.height() * ratio))],
            azimuth=c.azimuth, elevation=c.elevation, zoom=c.zoom, centre=c.centre.tolist(), half=c.half,
            u=self.model.packed_u(), probe=where[0] if where else None, grips=bool(where and where[1]),
        )  # fmt: skip

    def _just_above(self, point: FloatArray) -> list[float]:
        at = self.model.body.surface.nearest(point)
        return [*(at.point + self.model.radius * at.normal).tolist(), self.model.radius]

    # The mouse

    def mousePressEvent(self, event: QMouseEvent) -> None:
        at = event.position()
        if event.button() == Qt.MouseButton.LeftButton and self.model.ready:
            point = self.place(at)
            if point is not None:
                self._pressed = at, point
                self.model.ask("touch", point=point.tolist())
                return
        self._turning = at

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        at = event.position()
        if self._pressed is not None:
            began, point = self._pressed
            self.model.ask(
                "at", point=self._slid(point, at.x() - began.x()).tolist(), depth=(at.y() - began.y()) / PIXELS_PER_MM
            )
        elif self._turning is not None:
            moved, self._turning = at - self._turning, at
            self.turn(self.camera.azimuth - 0.5 * moved.x(), self.camera.elevation + 0.5 * moved.y())
        elif self.model.position() is None:
            self._hover, self._stale = self.place(at), True

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        if self._pressed is not None:
            began, point = self._pressed
            # A new touch, so that the way back is no part of the curve.
            self.model.ask("touch", point=self._slid(point, event.position().x() - began.x()).tolist())
        self._pressed = self._turning = None

    def _slid(self, point: FloatArray, across: float) -> FloatArray:
        """Where along the screen the probe has been taken, seen from the touched point (3,)."""
        if abs(across) <= _STICKS:
            return point
        way = (across - np.sign(across) * _STICKS) * self.camera.mm_per_pixel(self.width(), self.height())
        return np.asarray(point + way * self.camera.axes[0])

    def wheelEvent(self, event: QWheelEvent) -> None:
        zoom = float(np.clip(self.camera.zoom * 1.15 ** (event.angleDelta().y() / 120.0), 0.4, 6.0))
        self.turn(self.camera.azimuth, self.camera.elevation, zoom)

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._stale = True

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = begun(self, self._image)
        top = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
        text(painter, QRectF(8, 6, self.width() - 16, 16), _HELP, top, style.FAINT)
        words = self._state()
        if words:
            text(painter, QRectF(self.rect()), words, Qt.AlignmentFlag.AlignCenter, style.TEXT)
        directions(painter, self.camera, self.height())
        painter.end()

    def _state(self) -> str:
        if self.model.drawing.over:
            return "3D pictures cannot be drawn on this machine; try `palpate doctor`"
        if not self.model.ready:
            return "the organ is made ready \N{HORIZONTAL ELLIPSIS}"
        return "" if self._image is not None else "drawing \N{HORIZONTAL ELLIPSIS}"
