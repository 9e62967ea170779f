"""Shapes on a slice view: distances, angles and regions that are kept, what is being drawn, and the tool in force."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QPainter, QPen

from palpate.case.measured.measurements import REGIONS, Measurement
from palpate.imaging.labels import LABELS
from palpate.ui.desktop import style
from palpate.ui.desktop.session.display import PAINTS, Display
from palpate.ui.desktop.slices import slice_marks
from palpate.ui.desktop.slices.slice_viewport import Screen

TOOLS = {
    **{"look": "Look", "seed": "Point", "brush": "Brush", "eraser": "Eraser", "lasso": "Lasso", "polygon": "Polygon"},
    **{"window": "Window", "ruler": "Ruler", "angle": "Angle", "ellipse": "Ellipse", "region": "Free region"},
}
_WORDS_WIDE, _WORDS_HIGH = 180.0, 18.0
# Rows beside its shape that a value may stand in, the best first.
_ROWS = (0, -1, 1, -2, 2, -3, 3)
# Room of the letter at the right edge, pixels.
_LETTER = 24.0


def tool_words(painter: QPainter, screen: Screen, display: Display) -> str:
    """The tool in force, in the upper right corner; one that changes labels in another colour, with the label.

    The tool's name where it has no room there: it belongs to the captions then. Else empty.
    """
    name, room = TOOLS[display.tool], slice_marks.half(screen) - 8.0
    on = LABELS[display.label].replace("_", " ") if display.tool in PAINTS else ""
    on = display.seed_name.replace("_", " ") if display.tool == "seed" else on
    words = f"{name}: {on}" if on and slice_marks.wide(painter, f"{name}: {on}") <= room else name
    corner = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignTop
    tone = style.WARN if display.tool in (*PAINTS, "seed") else style.FAINT if display.tool == "look" else style.RULER
    if slice_marks.wide(painter, words) > room:
        return name
    slice_marks.text(painter, QRectF(screen.size.width() - 8 - room, 4, room, 16), words, corner, tone)
    return ""


def measurements(painter: QPainter, screen: Screen, kept: Sequence[tuple[Measurement, str]], position: float) -> None:
    """Kept measurements, where all of one lies near the slice; of regions, where they lie in this plane.

    kept : with their values in words, which are written over all lines, none over another one.
    """
    shown = [
        (one, words, pixels)
        for one, words in kept
        if (one.kind not in REGIONS or one.plane == screen.plane.name)
        and (pixels := _near(screen, one.points, position))
    ]
    for one, _, pixels in shown:
        _lines(painter, pixels, closed=one.kind in REGIONS, ends=one.kind not in REGIONS)
    written: list[QRectF] = []
    for one, words, pixels in shown:
        at = pixels[1] if one.kind == "angle" else max(pixels, key=lambda pixel: pixel.x())
        written.append(_value(painter, screen, words, at, written))


def _value(painter: QPainter, screen: Screen, words: str, at: QPointF, written: Sequence[QRectF]) -> QRectF:
    """Writes a value beside a point, off what is written already; where."""
    wide = slice_marks.wide(painter, words)
    left = max(8.0, min(at.x() + 8.0, screen.size.width() - wide - _LETTER))
    rows = [QRectF(left, at.y() + _WORDS_HIGH * (row - 0.5), wide, _WORDS_HIGH) for row in _ROWS]
    ink = next((row for row in rows if not any(row.intersects(other) for other in written)), rows[0])
    side = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
    slice_marks.text(painter, QRectF(left, ink.top(), _WORDS_WIDE, _WORDS_HIGH), words, side, style.RULER)
    return ink


def begun(painter: QPainter, screen: Screen, tool: str, points: Sequence[Sequence[float]], position: float) -> None:
    """A shape that is being drawn."""
    pixels = _near(screen, points, position)
    if pixels:
        _lines(
            painter, pixels, closed=tool in ("ellipse", "region", "lasso"), ends=tool in ("ruler", "angle", "polygon")
        )


def _near(screen: Screen, points: Sequence[Sequence[float]], position: float) -> list[QPointF]:
    """The points as pixels; none where one of them lies away from the slice."""
    plane = screen.plane
    if any(abs(point[plane.normal] - position) > slice_marks.NEAR_MM for point in points):
        return []
    return [screen.to_pixel(point[plane.across], point[plane.down]) for point in points]


def _lines(painter: QPainter, pixels: list[QPointF], closed: bool, ends: bool) -> None:
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for ink, width in ((QColor("black"), 4.0), (QColor(style.RULER), 1.8)):
        painter.setPen(QPen(ink, width))
        if closed:
            painter.drawPolygon(pixels)
        else:
            painter.drawPolyline(pixels)
        for pixel in pixels if ends else ():
            painter.drawEllipse(pixel, 3.0, 3.0)
