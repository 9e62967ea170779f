"""The 3D view: shows the pictures of the drawing process, and turns the mouse into its camera."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QImage, QMouseEvent, QPaintEvent, QResizeEvent, QWheelEvent
from PySide6.QtWidgets import QWidget

from palpate.case.identified import MAP_FILE
from palpate.core.arrays import FloatArray
from palpate.imaging.labels import ORGAN_LABELS
from palpate.ui.desktop import style
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.slices import overlay
from palpate.ui.desktop.slices.slice_marks import text
from palpate.ui.desktop.slices.slice_view import DOUBLES_PIXELS
from palpate.ui.desktop.solid.camera import Camera
from palpate.ui.desktop.solid.renderer_client import SolidClient
from palpate.ui.desktop.solid.solid_marks import begun, directions, image_of
from palpate.ui.desktop.solid.view_request import MapRequest, ViewRequest
from palpate.ui.pictures.colours import AROUND_OPACITY, UNDETERMINED, label_rgb

_AROUND = {label: (*label_rgb(label), opacity) for label, opacity in AROUND_OPACITY.items()}
_HALVES = {label: (*label_rgb(label), 1.0) for label in ORGAN_LABELS}
_UNTOLD, _DEFORMED = (*UNDETERMINED, 1.0), (0.35, 0.65, 1.0, 0.45)


class SolidView(QWidget):
    """azimuth, elevation : degrees; 0, 0 looks from the front. enlarge : what a double click does."""

    def __init__(
        self, controller: Controller, folder: Path, enlarge: Callable[[QWidget], None] = lambda view: None
    ) -> None:
        super().__init__()
        self._enlarge = enlarge
        self._zooms = False
        self.controller = controller
        self.client = SolidClient(folder)
        self.azimuth, self.elevation, self.zoom = 25.0, 15.0, 1.0
        self._image: QImage | None = None
        self._pressed: QPointF | None = None
        # _version grows with the case's results. _awaited : the first picture of the case as it is; 0 while it is not
        # asked for, None when it is here.
        self._version = 0
        self._awaited: int | None = None
        self._stale = {"labels": True, "scan": True, "points": True, "view": True}
        self.setMinimumSize(QSize(88, 140))
        self.setAccessibleName("3D view")

    def on_change(self, what: str) -> None:
        """Something has changed; it is sent with the next tick."""
        if what in ("case", "labels"):
            self._stale |= {"labels": True, "view": True}
        if what == "case":
            self._stale |= {"scan": True, "points": True}
            self._version += 1
            self._awaited = 0
        if what in ("view", "results"):
            self._stale["view"] = True

    def tick(self) -> None:
        """Called every few tens of milliseconds: takes a picture that has come and asks for the next where it is needed."""
        came = self.client.latest()
        if came is not None:
            self._image = image_of(came)
            if self._awaited and came.head["id"] >= self._awaited:
                self._awaited = None
            self.update()
        if self.isVisible() and self._stale["view"] and not self.client.busy and not self.client.failure:
            self._send()

    @property
    def settled(self) -> bool:
        """Whether the picture shows the case as it is, or none can be drawn."""
        return bool(self.client.failure) or not (self.client.busy or self._stale["view"])

    def _send(self) -> None:
        controller = self.controller
        if self._stale["labels"]:
            for state in ("rest", "deformed"):
                volume = controller.labels(state)
                if volume is not None:
                    self.client.labels(state, volume)
        ct = controller.ct("rest")
        if self._stale["scan"] and ct is not None:
            self.client.scan(controller.scans["rest"].file, ct.affine)
        if self._stale["points"]:
            self.client.points(self._misfit())
        self._stale = dict.fromkeys(self._stale, False)
        number = self.client.view(**self._how())
        self._awaited = number if self._awaited == 0 else self._awaited

    def _how(self) -> ViewRequest:
        display = self.controller.display
        states = {"rest": ["rest"], "deformed": ["deformed"]}.get(display.mode, ["rest", "deformed"])
        # While it is turned, half the pixels each way: without a graphics card that is four times as fast.
        turning = self._pressed is not None
        ratio = self.devicePixelRatioF() * (0.5 if turning else 1.0)
        return {
            "size": [max(64, int(self.width() * ratio)), max(64, int(self.height() * ratio))],
            "azimuth": self.azimuth, "elevation": self.elevation, "zoom": self.zoom,
            "crosshair": list(display.crosshair), "states": states, "colours": self._colours(states),
            "planes": ["axial"], "window": [display.centre, display.width],
            "residual": display.overlay == "misfit", "map": self._map(), "fast": turning,
        }  # fmt: skip

    def _map(self) -> MapRequest | None:
        """What colours the organ at rest where the map is shown."""
        case, display = self.controller.case, self.controller.display
        if case is None or case.stiffness_map is None or display.overlay != "map":
            return None
        scale = self.controller.scale
        return {
            "file": str(case.folder.file(MAP_FILE)), "version": self._version,
            "scale": (scale.low, scale.high, scale.log, scale.colours), "untold": [round(255 * c) for c in _UNTOLD[:3]],
            "low_kpa": display.low_kpa, "high_kpa": display.high_kpa, "surest_factor": display.surest_factor,
        }  # fmt: skip

    def _colours(self, states: list[str]) -> dict[str, list[float]]:
        case, display = self.controller.case, self.controller.display
        organ = dict(_HALVES)
        if display.overlay == "stiffness" and case is not None and case.regions:
            table = overlay.painted_stiffness(display, case.regions, self.controller.scale).table
            organ = {k: (*(c / 255.0 for c in table[k][:3]), 1.0) if k in table else _UNTOLD for k in ORGAN_LABELS}  # type: ignore[misc]
        elif display.overlay in ("map", "misfit"):
            organ = dict.fromkeys(ORGAN_LABELS, _UNTOLD)  # no colour that the bar would seem to explain
        out = {}
        for state in states:
            around = state == states[0]
            for label in (*ORGAN_LABELS, *_AROUND):
                if not around:
                    rgba = _DEFORMED if label in ORGAN_LABELS else (0.0, 0.0, 0.0, 0.0)
                else:
                    rgba = organ[label] if label in organ else _AROUND[label]
                out[f"{state} {label}"] = [*(float(c) for c in rgba[:3]), float(rgba[3]) * display.opacity_of(label)]
        return out

    def _misfit(self) -> FloatArray | None:
        gap = None if self.controller.case is None else self.controller.case.gap
        if gap is None:
            return None
        rgb = overlay.residual_rgb(gap.residual, overlay.residual_limit(gap.residual))
        return np.column_stack([gap.points, gap.residual, rgb])

    # Qt

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = begun(self, self._image)
        top = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
        text(painter, QRectF(8, 6, 260, 16), "3D", top)
        wrapped = top | Qt.TextFlag.TextWordWrap
        text(painter, QRectF(8, 22, self.width() - 12, 96), self._note(), wrapped, style.FAINT)
        if self.client.failure or self._image is None or self._awaited is not None:
            words = self.client.failure or "drawing \N{HORIZONTAL ELLIPSIS}"
            middle = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            text(painter, QRectF(self.rect().adjusted(4, 0, -4, 0)), words, middle, style.TEXT)
        directions(painter, self._camera(), self.height())
        painter.end()

    def _note(self) -> str:
        """What colours of the organ mean that no bar tells."""
        display = self.controller.display
        words = ["blue: organ deformed"] if display.mode in ("side by side", "blend") else []
        words += ["grey: not determined by the map"] if display.overlay == "map" and display.mode != "deformed" else []
        return "; ".join([*words, *filter(None, [overlay.only_at_rest(display.overlay, display.mode)])])

    def _camera(self) -> Camera:
        """How the patient is seen; the drawing process knows where the organ is and how large."""
        return Camera(self.azimuth, self.elevation, self.zoom, np.zeros(3), 1.0)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        self._pressed, self._zooms = event.position(), event.button() == Qt.MouseButton.RightButton

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        if event.button() == Qt.MouseButton.LeftButton:
            self._pressed = None
            self._enlarge(self)

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        if self._pressed is None:
            return
        moved = event.position() - self._pressed
        self._pressed = event.position()
        if self._zooms:
            self._magnify(2.0 ** (-moved.y() / DOUBLES_PIXELS))
        else:
            self.azimuth -= 0.5 * moved.x()
            self.elevation = float(np.clip(self.elevation + 0.5 * moved.y(), -89.0, 89.0))
        self._stale["view"] = True
        self.update()

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        self._pressed = None
        self._stale["view"] = True

    def wheelEvent(self, event: QWheelEvent) -> None:
        self._magnify(1.15 ** (event.angleDelta().y() / 120.0))
        self._stale["view"] = True

    def _magnify(self, factor: float) -> None:
        self.zoom = float(np.clip(self.zoom * factor, 0.3, 10.0))

    def resizeEvent(self, event: QResizeEvent) -> None:
        self._stale["view"] = True
