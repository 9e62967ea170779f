"""What is written on a slice view: letters, scale bar, position, crosshair, seeds, misfit points, hatching."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QBrush, QColor, QFont, QFontMetricsF, QPainter, QPainterPath, QPen

from palpate.core.arrays import FloatArray, LabelArray
from palpate.ui.desktop import style
from palpate.ui.desktop.slices.slice_viewport import Screen
from palpate.ui.pictures.gap_pictures import LONGER, SLAB_MM
from palpate.ui.pictures.slice_axes import LETTER_FONT

_BARS_MM = (1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0)
NEAR_MM = 3.0
# Where the edge of a letter is drawn, pixels: around it, one and two away.
_EDGE = [(dx, dy) for dx in (-2, -1, 0, 1, 2) for dy in (-2, -1, 0, 1, 2) if 0 < dx * dx + dy * dy <= 5]
_SHORT = {"Axial": "Ax", "Sagittal": "Sag", "Coronal": "Cor"}


def text(painter: QPainter, where: QRectF, words: str, flags: Qt.AlignmentFlag, colour: str = style.TEXT) -> None:
    """Words with a black edge two pixels wide, so that they are read on bone, on air and on every grey between."""
    painter.setPen(QColor("black"))
    for dx, dy in _EDGE:
        painter.drawText(where.translated(dx, dy), int(flags), words)
    painter.setPen(QColor(colour))
    painter.drawText(where, int(flags), words)


def letters(painter: QPainter, screen: Screen) -> None:
    """Which way the patient lies, at the four edges."""
    font = QFont(LETTER_FONT, 11)
    font.setBold(True)
    painter.setFont(font)
    w, h, plane, middle = screen.size.width(), screen.size.height(), screen.plane, Qt.AlignmentFlag.AlignCenter
    text(painter, QRectF(2, h / 2 - 10, 18, 20), plane.left, middle)
    text(painter, QRectF(w - 20, h / 2 - 10, 18, 20), plane.right, middle)
    text(painter, QRectF(w / 2 - 10, 2, 20, 18), plane.top, middle)
    text(painter, QRectF(w / 2 - 10, h - 20, 20, 18), plane.bottom, middle)


def captions(painter: QPainter, screen: Screen, plane: str, state: str, further: Sequence[str]) -> None:
    """Which slice it is, in the upper left corner: on one line left of the letter above where there is room, else below it."""
    room, corner = half(screen) - 8.0, Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
    whole, lines = f"{plane}, {state}", [*further]
    if wide(painter, whole) <= room:
        first = whole
    else:
        first = plane if wide(painter, plane) <= room else _SHORT[plane]
        lines = [state, *further]
    text(painter, QRectF(8, 4, room, 16), first, corner)
    most = screen.size.width() - 12.0
    for row, words in enumerate(filter(None, lines), start=1):
        if wide(painter, words) > most:
            words = words.removesuffix(" mm")
        if wide(painter, words) > most and words.startswith("slice "):
            words = words.partition(",")[0]
        # The last words may need further lines; they end above the letter at the left.
        top = 4.0 + 16.0 * row
        room = max(16.0, min(48.0, screen.size.height() / 2.0 - 12.0 - top))
        text(painter, QRectF(8, top, most, room), words, corner | Qt.TextFlag.TextWordWrap)


def window_words(painter: QPainter, screen: Screen, centre: float, width: float) -> None:
    """Window and level, in this order as everywhere, in the lower right corner, as long as there is room beside the letter below."""
    size, low = screen.size, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignBottom
    room = half(screen) - 8.0
    forms = tuple(f"W {width:.0f}{gap}L {centre:.0f}".replace("-", "\N{MINUS SIGN}") for gap in ("  ", " "))
    words = next((form for form in forms if wide(painter, form) <= room), "")
    text(painter, QRectF(size.width() - 8 - room, size.height() - 24, room, 18), words, low)


def half(screen: Screen) -> float:
    """Pixels from an edge to the letter in the middle of a side."""
    return screen.size.width() / 2.0 - 12.0


def wide(painter: QPainter, words: str) -> float:
    return QFontMetricsF(painter.font()).horizontalAdvance(words) + 1.0


def scale_bar(painter: QPainter, screen: Screen) -> None:
    """A bar of a round length, at most a quarter of the view."""
    mm = screen.viewport.mm_per_pixel
    longest = 0.25 * screen.size.width() * mm
    length = max((bar for bar in _BARS_MM if bar <= longest), default=_BARS_MM[0])
    x, y, pixels = 12.0, screen.size.height() - 12.0, length / mm
    for width, tone in ((5.0, QColor(0, 0, 0, 200)), (2.5, QColor("white"))):
        painter.setPen(QPen(tone, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
        painter.drawLine(QPointF(x, y), QPointF(x + pixels, y))
    corner = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignBottom
    words = f"{length:g} mm"
    # Beside the letter below where there is room for both, else above it.
    low = y - 4.0 if x + wide(painter, words) <= half(screen) else y - 10.0
    text(painter, QRectF(x, low - 18, 90, 18), words, corner)


def crosshair(painter: QPainter, screen: Screen, at: Sequence[float]) -> None:
    """Two thin lines with a gap where they meet, so that what is pointed at stays visible."""
    p = screen.to_pixel(at[screen.plane.across], at[screen.plane.down])
    painter.setPen(QPen(style.colour(style.CROSSHAIR, 170), 1.0))
    w, h, gap = screen.size.width(), screen.size.height(), 9.0
    for a, b in (((0, p.y()), (p.x() - gap, p.y())), ((p.x() + gap, p.y()), (w, p.y())),
                 ((p.x(), 0), (p.x(), p.y() - gap)), ((p.x(), p.y() + gap), (p.x(), h))):  # fmt: skip
        painter.drawLine(QPointF(*a), QPointF(*b))


def seeds(painter: QPainter, screen: Screen, found: Mapping[str, Sequence[float]], position: float) -> None:
    """A ring with its name where a person has pointed; faint when it lies in a slice nearby."""
    for name, point in found.items():
        away = abs(point[screen.plane.normal] - position)
        if away > 5 * NEAR_MM:
            continue
        tone = style.colour(style.SEED, 255 if away <= NEAR_MM else 90)
        p = screen.to_pixel(point[screen.plane.across], point[screen.plane.down])
        painter.setBrush(Qt.BrushStyle.NoBrush)
        # Dark around light around colour: to be seen on any label and on bone.
        for ink, width in (
            (QColor(0, 0, 0, tone.alpha()), 5.0),
            (QColor(255, 255, 255, tone.alpha()), 3.6),
            (tone, 2.0),
        ):
            painter.setPen(QPen(ink, width))
            painter.drawEllipse(p, 6.0, 6.0)
        painter.drawPoint(p)
        if away <= NEAR_MM:
            left = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
            text(painter, QRectF(p.x() + 10, p.y() - 9, 90, 18), name, left, style.SEED)


def misfit_points(painter: QPainter, screen: Screen, points: FloatArray, rgb: LabelArray, position: float) -> None:
    """Points of the organ's surface near the slice, coloured by the model's misfit there."""
    plane = screen.plane
    near = np.flatnonzero(np.abs(points[:, plane.normal] - position) <= NEAR_MM / 2.0)
    painter.setPen(QPen(QColor(0, 0, 0, 120), 0.8))
    for n in near:
        painter.setBrush(QColor(*(int(c) for c in rgb[n])))
        painter.drawEllipse(screen.to_pixel(points[n, plane.across], points[n, plane.down]), 4.0, 4.0)


def missed_motion(
    painter: QPainter, screen: Screen, places: FloatArray, missed: FloatArray, rgb: LabelArray, position: float
) -> None:
    """Arrows near the slice from where tissue was at rest, `LONGER` times predicted minus matched motion (w, 3) mm, in colours (w, 3)."""
    plane = screen.plane
    for n in np.flatnonzero(np.abs(places[:, plane.normal] - position) <= SLAB_MM):
        start, end = (
            screen.to_pixel(x[plane.across], x[plane.down]) for x in (places[n], places[n] + LONGER * missed[n])
        )
        for ink, width in ((QColor(0, 0, 0, 160), 4.0), (QColor(*(int(c) for c in rgb[n])), 2.0)):
            painter.setPen(QPen(ink, width))
            painter.drawLine(start, end)
            painter.drawEllipse(end, 1.5, 1.5)


def hatch(painter: QPainter, paths: Iterable[QPainterPath]) -> None:
    """White strokes where the pair does not tell the stiffness."""
    brush = QBrush(QColor(255, 255, 255, 150), Qt.BrushStyle.BDiagPattern)
    for path in paths:
        painter.fillPath(path, brush)


def position_words(screen: Screen, position: float, slices: tuple[int, int] | None = None) -> str:
    """``slice 12 of 60, z = -148.0 mm`` with a true minus sign. slices : which one of how many, where there is a scan."""
    sign = "\N{MINUS SIGN}" if position < 0 else ""
    place = f"{'xyz'[screen.plane.normal]} = {sign}{abs(position):.1f} mm"
    return place if slices is None else f"slice {slices[0]} of {slices[1]}, {place}"
