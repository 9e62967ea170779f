"""What one slice view paints: scan, labels or stiffness over it, outlines and marks, as the controller shows them."""

from __future__ import annotations

from PySide6.QtCore import QPoint, QPointF, QRect, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPainterPath, QPen, QPolygonF

from palpate.case.measured.measurements import REGIONS
from palpate.imaging.labels import ORGAN_LABELS
from palpate.ui.desktop import style
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.slices import overlay, shape_marks, slice_marks
from palpate.ui.desktop.slices.map_layer import map_layer
from palpate.ui.desktop.slices.slice_layers import Kept, grey_image, label_image, outline_paths, sampled_slice
from palpate.ui.desktop.slices.slice_sampling import SampledSlice, numbered, scan_outline
from palpate.ui.desktop.slices.slice_viewport import Screen
from palpate.ui.pictures.colours import OUTLINES
from palpate.ui.pictures.gap_pictures import motion_rgb
from palpate.ui.pictures.planes import Plane

BLEND = "blend"


class SlicePicture:
    """plane : which. state : "rest", "deformed", or BLEND for one over the other. labels_version : grows with the labels.

    Keeps what it has cut and coloured till that changes.
    """

    def __init__(self, controller: Controller, plane: Plane, state: str) -> None:
        self._controller, self._plane, self._state = controller, plane, state
        self._kept = Kept()
        self.labels_version = 0

    def paint(self, painter: QPainter, screen: Screen, position: float) -> None:
        """The slice at a position along its normal, mm."""
        states = ("rest", "deformed") if self._state == BLEND else (self._state,)
        shown = {state: self._scan(painter, screen, position, state) for state in states}
        for state, scan in shown.items():
            painter.save()
            if scan is not None:  # what labels carry on beyond the scan, nobody has seen
                painter.setClipPath(scan)
            self._overlay(painter, screen, position, state)
            painter.restore()
        self._marks(painter, screen, position, any(scan is not None for scan in shown.values()))

    def _scan(self, painter: QPainter, screen: Screen, position: float, state: str) -> QPainterPath | None:
        """Draws the scan; where it lies on the screen."""
        volume = self._controller.ct(state)
        if volume is None:
            return None
        version = hash((id(volume.array), volume.affine.tobytes()))
        sampled = sampled_slice(self._kept, f"ct {state}", volume, version, screen, position)
        if sampled is None:
            return None
        painter.setOpacity(self._controller.display.blend if self._state == BLEND and state == "deformed" else 1.0)
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        place = screen.rect(sampled.extent)
        painter.drawImage(place, grey_image(self._kept, state, sampled, self._controller.display.window))
        painter.setOpacity(1.0)
        outline = QPainterPath()
        outline.addPolygon(QPolygonF([QPointF(*at) for at in scan_outline(volume, self._plane, position)]))
        return screen.transform().map(outline)

    def _overlay(self, painter: QPainter, screen: Screen, position: float, state: str) -> None:
        labels, display = self._controller.labels(state), self._controller.display
        sampled = None
        if labels is not None:
            sampled = sampled_slice(self._kept, f"labels {state}", labels, self.labels_version, screen, position)
        if sampled is None:
            return
        painted = self._painted()
        in_mm, to_pixels = outline_paths(self._kept, state, sampled, tuple(OUTLINES)), screen.transform()
        paths = {label: to_pixels.map(path) for label, path in in_mm.items() if display.opacity_of(label) > 0.0}
        if display.overlay == "map" and state == "rest":
            self._map(painter, screen, position, sampled)
        if painted is not None and (self._state != BLEND or state == "rest"):
            painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, False)
            painter.drawImage(screen.rect(sampled.extent), label_image(self._kept, state, sampled, painted.table))
            hatched = [path for label, path in paths.items() if label in painted.hatched]
            slice_marks.hatch(painter, hatched)
        if display.outlines:
            dashes = Qt.PenStyle.DashLine if self._state == BLEND and state == "deformed" else Qt.PenStyle.SolidLine
            for label, path in paths.items():
                painter.setPen(QPen(QColor(OUTLINES[label]), 1.3, dashes))
                painter.setBrush(Qt.BrushStyle.NoBrush)
                painter.drawPath(path)

    def _map(self, painter: QPainter, screen: Screen, position: float, sampled: SampledSlice) -> None:
        case, display = self._controller.case, self._controller.display
        if case is None or case.stiffness_map is None:
            return
        arrays, scale = case.stiffness_map, self._controller.scale
        key = (id(sampled), id(arrays), display.opacity, display.low_kpa, display.high_kpa, display.surest_factor, scale,
               *(display.opacity_of(label) for label in ORGAN_LABELS))  # fmt: skip
        layer = self._kept.get("map", key, lambda: map_layer(arrays, sampled, self._plane, position, display, scale))
        painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
        painter.drawImage(screen.rect(sampled.extent), layer.image)
        slice_marks.hatch(painter, [screen.transform().map(path) for path in layer.hatched])
        for paths, dashes in ((layer.stiffer, Qt.PenStyle.SolidLine), (layer.softer, Qt.PenStyle.DashLine)):
            painter.setPen(QPen(QColor("white"), 1.6, dashes))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            for path in paths:
                painter.drawPath(screen.transform().map(path))

    def _painted(self) -> overlay.Painted | None:
        case, display = self._controller.case, self._controller.display
        if display.overlay == "labels":
            return overlay.painted_labels(display)
        if display.overlay == "stiffness" and case is not None and case.regions:
            return overlay.painted_stiffness(display, case.regions, self._controller.scale)
        return None

    def _shapes(self, painter: QPainter, screen: Screen, position: float) -> None:
        """What is measured on this slice, and what is being drawn on it."""
        measuring, drawing = self._controller.measuring, self._controller.drawing
        kept = [one for one in measuring.kept if one.kind not in REGIONS or self._state != "deformed"]
        shape_marks.measurements(painter, screen, [(one, measuring.short_words(one)) for one in kept], position)
        if drawing.plane is self._plane and (drawing.state == "deformed") == (self._state == "deformed"):
            shape_marks.begun(painter, screen, drawing.tool, drawing.outline, position)

    def _number(self, position: float) -> tuple[int, int] | None:
        """Which slice of how many."""
        ct = self._controller.ct("deformed" if self._state == "deformed" else "rest")
        return None if ct is None else numbered(ct, self._plane, position)

    def _marks(self, painter: QPainter, screen: Screen, position: float, shown: bool) -> None:
        case, display = self._controller.case, self._controller.display
        if case is not None and case.gap is not None and display.overlay == "misfit" and self._state != "deformed":
            rgb = overlay.residual_rgb(case.gap.residual, overlay.residual_limit(case.gap.residual))
            slice_marks.misfit_points(painter, screen, case.gap.points, rgb, position)
            slice_marks.missed_motion(
                painter, screen, case.gap.places, case.gap.missed, motion_rgb(case.gap.missed_sd), position
            )
        slice_marks.crosshair(painter, screen, display.crosshair)
        if case is not None:
            slice_marks.seeds(
                painter, screen, case.seeds["deformed" if self._state == "deformed" else "rest"], position
            )
        slice_marks.letters(painter, screen)
        painter.setFont(QFont("DejaVu Sans", 8))
        slice_marks.scale_bar(painter, screen)
        name = {"rest": "at rest", "deformed": "deformed", BLEND: "rest, deformed dashed"}[self._state]
        there = case is not None and (case.stiffness_map if display.overlay == "map" else case.gap) is not None
        why = overlay.only_at_rest(display.overlay, self._state) if there else ""
        place = slice_marks.position_words(screen, position, self._number(position))
        self._shapes(painter, screen, position)
        tool = shape_marks.tool_words(painter, screen, display)
        slice_marks.captions(painter, screen, self._plane.name.capitalize(), name, (tool, place, why))
        slice_marks.window_words(painter, screen, display.centre, display.width)
        if not shown:
            text = "reading the scan \N{HORIZONTAL ELLIPSIS}" if self._controller.reader.running else "no scan here"
            slice_marks.text(
                painter, QRectF(QRect(QPoint(), screen.size)), text, Qt.AlignmentFlag.AlignCenter, style.FAINT
            )
