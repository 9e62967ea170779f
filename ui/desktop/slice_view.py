"""One slice view: draws what the controller shows, and turns mouse and wheel into its calls."""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QMouseEvent, QPainter, QPaintEvent, QPen, QWheelEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from palpate.core.errors import InputError
from palpate.ui.desktop import overlay, slice_marks, style
from palpate.ui.desktop.controller import Controller
from palpate.ui.desktop.field import Field, Screen
from palpate.ui.desktop.map_layer import map_layer
from palpate.ui.desktop.sheets import Sheet
from palpate.ui.desktop.slice_layers import Kept, grey_image, label_image, outline_paths, sheet_of
from palpate.ui.pictures.planes import Plane

BLEND = "blend"
_LEFT, _RIGHT, _MIDDLE = Qt.MouseButton.LeftButton, Qt.MouseButton.RightButton, Qt.MouseButton.MiddleButton


class SliceView(QWidget):
    """plane : which. state : "rest", "deformed", or "blend" for one over the other. field : shared by all views."""

    def __init__(self, controller: Controller, field: Field, plane: Plane, state: str) -> None:
        super().__init__()
        self.controller, self.field, self.plane, self.state = controller, field, plane, state
        self._kept = Kept()
        self._version = 0
        self._pressed: Any = None
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
        return Screen(self.plane, self.field, self.size())

    @property
    def position(self) -> float:
        """Of the slice along its normal, mm."""
        return self.controller.display.crosshair[self.plane.normal]

    def told(self, what: str) -> None:
        """Something has changed."""
        if what in ("case", "labels"):
            self._version += 1
        if what in ("case", "labels", "view", "tools", "results"):
            self.update()

    # Drawing

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.fillRect(self.rect(), QColor("black"))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        screen = self.screen_map
        states = ("rest", "deformed") if self.state == BLEND else (self.state,)
        shown = [self._scan(painter, screen, state) for state in states]
        for state in states:
            self._overlay(painter, screen, state)
        self._marks(painter, screen, any(shown))
        if self.hasFocus() and not any(shown):
            painter.setPen(QPen(style.colour(style.ACCENT), 1.0))
        painter.end()

    def _scan(self, painter: QPainter, screen: Screen, state: str) -> bool:
        volume = self.controller.ct(state)
        if volume is None:
            return False
        version = hash((id(volume.array), volume.affine.tobytes()))
        sheet = sheet_of(self._kept, f"ct {state}", volume, version, screen, self.position)
        if sheet is None:
            return False
        painter.setOpacity(self.controller.display.blend if self.state == BLEND and state == "deformed" else 1.0)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(
            screen.rect(sheet.extent), grey_image(self._kept, state, sheet, self.controller.display.window)
        )
        painter.setOpacity(1.0)
        return True

    def _overlay(self, painter: QPainter, screen: Screen, state: str) -> None:
        labels, display = self.controller.labels(state), self.controller.display
        sheet = None
        if labels is not None:
            sheet = sheet_of(self._kept, f"labels {state}", labels, self._version, screen, self.position)
        if sheet is None:
            return
        painted = self._painted()
        in_mm, to_pixels = outline_paths(self._kept, state, sheet, tuple(overlay.OUTLINED)), screen.transform()
        paths = {label: to_pixels.map(path) for label, path in in_mm.items()}
        if display.overlay == "map" and state == "rest":
            self._map(painter, screen, sheet)
        if painted is not None and (self.state != BLEND or state == "rest"):
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, False)
            painter.drawImage(screen.rect(sheet.extent), label_image(self._kept, state, sheet, painted.table))
            hatched = [path for label, path in paths.items() if label in painted.hatched]
            slice_marks.hatch(painter, hatched)
        if display.outlines:
            dashes = Qt.PenStyle.DashLine if self.state == BLEND and state == "deformed" else Qt.PenStyle.SolidLine
            for label, path in paths.items():
                painter.setPen(QPen(QColor(overlay.OUTLINED[label]), 1.3, dashes))
                painter.setBrush(Qt.BrushStyle.NoBrush)
                painter.drawPath(path)

    def _map(self, painter: QPainter, screen: Screen, sheet: Sheet) -> None:
        case, display = self.controller.case, self.controller.display
        if case is None or case.stiffness_map is None:
            return
        arrays, scale = case.stiffness_map, case.map_scale
        key = (id(sheet), id(arrays), display.opacity, display.low_kpa, display.high_kpa, display.surest_factor)
        layer = self._kept.get("map", key, lambda: map_layer(arrays, sheet, self.plane, self.position, display, scale))
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(screen.rect(sheet.extent), layer.image)
        slice_marks.hatch(painter, [screen.transform().map(path) for path in layer.hatched])

    def _painted(self) -> overlay.Painted | None:
        case, display = self.controller.case, self.controller.display
        if display.overlay == "labels":
            return overlay.painted_labels(display)
        if display.overlay == "stiffness" and case is not None and case.regions:
            return overlay.painted_stiffness(display, case.regions, case.scale)
        return None

    def _marks(self, painter: QPainter, screen: Screen, shown: bool) -> None:
        case, display = self.controller.case, self.controller.display
        if case is not None and case.gap is not None and display.overlay == "misfit" and self.state != "deformed":
            rgb = overlay.residual_rgb(case.gap.residual, overlay.residual_limit(case.gap.residual))
            slice_marks.misfit_points(painter, screen, case.gap.points, rgb, self.position)
        slice_marks.crosshair(painter, screen, display.crosshair)
        if case is not None:
            slice_marks.seeds(painter, screen, case.seeds[self.editing_state], self.position)
        slice_marks.letters(painter, screen)
        painter.setFont(QFont("DejaVu Sans", 8))
        slice_marks.scale_bar(painter, screen)
        name = {"rest": "at rest", "deformed": "deformed", BLEND: "rest, deformed dashed"}[self.state]
        there = case is not None and (case.stiffness_map if display.overlay == "map" else case.gap) is not None
        why = overlay.only_at_rest(display.overlay, self.state) if there else ""
        place = slice_marks.position_words(screen, self.position)
        slice_marks.captions(painter, screen, self.plane.name.capitalize(), name, (place, why))
        slice_marks.window_words(painter, screen, display.centre, display.width)
        if not shown:
            text = "reading the scan \N{HORIZONTAL ELLIPSIS}" if self.controller.reader.running else "no scan here"
            slice_marks.text(painter, QRectF(self.rect()), text, Qt.AlignmentFlag.AlignCenter, style.FAINT)
        if display.tool in ("brush", "eraser") and self._mouse is not None:
            painter.setPen(QPen(QColor("white"), 1.2))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            radius = display.radius_mm / self.field.mm_per_pixel
            painter.drawEllipse(self._mouse, radius, radius)

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
            self.field.centre[self.plane.across] -= moved.x() * self.field.mm_per_pixel
            self.field.centre[self.plane.down] -= self.plane.down_sign * moved.y() * self.field.mm_per_pixel
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

    def leaveEvent(self, event: Any) -> None:
        self._mouse = None
        self.update()

    def wheelEvent(self, event: QWheelEvent) -> None:
        turns = event.angleDelta().y() / 120.0
        if event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            self.field.zoom(1.15**turns)
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
