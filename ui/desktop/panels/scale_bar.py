"""A bar of colours with its values beside it, as it is painted in every window."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.ticker import LogLocator, MaxNLocator
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QLinearGradient, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from palpate.ui.desktop import style
from palpate.ui.pictures.colours import STIFFNESS_LABEL, StiffnessScale

WIDTH, TOP, BOTTOM = 92, 34.0, 16.0
_LEFT, _WIDE = 26.0, 16.0


class ScaleBar(QWidget):
    """The bar of one kPa scale that does not change. marked : values with a line across the bar, kPa."""

    def __init__(self, scale: StiffnessScale, marked: list[float]) -> None:
        super().__init__()
        self._scale, self._marked = scale, marked
        self.setFixedWidth(WIDTH)
        self.setAccessibleName("colours of the stiffness")

    def sizeHint(self) -> QSize:
        return QSize(WIDTH, 300)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(QFont("DejaVu Sans", 8))
        draw_stiffness_bar(painter, self.height(), self._scale, self._marked)
        painter.end()


def draw_stiffness_bar(painter: QPainter, height: int, scale: StiffnessScale, marked: list[float]) -> None:
    """The bar of a kPa scale in a widget of that height."""
    ticks = LogLocator(subs=(1, 2, 5)) if scale.log else MaxNLocator(6)
    shares = {float(v): float(scale.norm(v)) for v in ticks.tick_values(scale.low, scale.high)}
    draw_bar(painter, height, lambda share: QColor.fromRgbF(*scale.colormap(share)[:3]), shares, STIFFNESS_LABEL)
    bar = _rect(height)
    for G in marked:
        y = _y(bar, min(max(float(scale.norm(G)), 0.0), 1.0))
        painter.setPen(QPen(QColor("white"), 2.0))
        painter.drawLine(QPointF(bar.left() - 3, y), QPointF(bar.right() + 1, y))


def draw_bar(
    painter: QPainter, height: int, colour_of: Callable[[float], QColor], shares: Mapping[float, float], words: str
) -> None:
    """A bar from 0 below to 1 above. shares : value -> where it stands. words : along the bar."""
    bar = _rect(height)
    gradient = QLinearGradient(bar.bottomLeft(), bar.topLeft())
    for share in np.linspace(0.0, 1.0, 33):
        gradient.setColorAt(float(share), colour_of(float(share)))
    painter.fillRect(bar, gradient)
    painter.setPen(QPen(QColor(style.FAINT), 1.0))
    painter.drawRect(bar)
    painter.setPen(QColor(style.TEXT))
    for value, share in shares.items():
        if -1e-9 <= share <= 1.0 + 1e-9:
            y = _y(bar, share)
            painter.drawLine(QPointF(bar.right(), y), QPointF(bar.right() + 4, y))
            side = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
            label = f"{value:g}".replace("-", "\N{MINUS SIGN}")
            painter.drawText(QRectF(bar.right() + 7, y - 8, 44, 16), int(side), label)
    painter.save()
    painter.translate(8.0, bar.center().y())
    painter.rotate(-90.0)
    painter.drawText(QRectF(-200, -8, 400, 16), int(Qt.AlignmentFlag.AlignCenter), words)
    painter.restore()


def _rect(height: int) -> QRectF:
    return QRectF(_LEFT, TOP, _WIDE, height - TOP - BOTTOM)


def _y(bar: QRectF, share: float) -> float:
    return bar.bottom() - share * bar.height()
