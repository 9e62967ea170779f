"""Histograms beside each other, as bars with the ends of their axes."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

from palpate.ui.desktop import style
from palpate.ui.desktop.session.labels.histograms import Histogram


class HistogramChart(QWidget):
    """Histograms of one label; title : what they are of."""

    def __init__(self) -> None:
        super().__init__()
        self._shown: Sequence[Histogram] = ()
        self._title = ""
        self.setMinimumHeight(190)
        self.setAccessibleName("histograms")

    def sizeHint(self) -> QSize:
        return QSize(600, 190)

    def show_histograms(self, title: str, shown: Sequence[Histogram]) -> None:
        """Draws these."""
        self._title, self._shown = title, shown
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setFont(QFont("DejaVu Sans", 8))
        painter.setPen(QColor(style.TEXT))
        middle = int(Qt.AlignmentFlag.AlignCenter)
        painter.drawText(QRectF(0, 0, self.width(), 18), middle, self._title)
        wide = self.width() / max(len(self._shown), 1)
        for number, one in enumerate(self._shown):
            self._bars(painter, QRectF(number * wide + 44, 22, wide - 60, self.height() - 62), one)
        painter.end()

    def _bars(self, painter: QPainter, box: QRectF, one: Histogram) -> None:
        most = float(one.counts.max())
        step = box.width() / len(one.counts)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(style.ACCENT))
        for number, count in enumerate(one.counts):
            high = box.height() * float(count) / most
            painter.drawRect(QRectF(box.left() + number * step, box.bottom() - high, max(step - 1.0, 1.0), high))
        painter.setPen(QColor(style.FAINT))
        painter.drawLine(box.bottomLeft(), box.bottomRight())
        right, left = int(Qt.AlignmentFlag.AlignRight), int(Qt.AlignmentFlag.AlignLeft)
        ends = [f"{edge:.0f}".replace("-", "\N{MINUS SIGN}") for edge in (one.edges[0], one.edges[-1])]
        below = box.bottom() + 2
        painter.drawText(QRectF(box.left(), below, box.width(), 16), left, ends[0])
        painter.drawText(QRectF(box.left(), below, box.width(), 16), right, ends[1])
        painter.drawText(
            QRectF(box.left(), below + 14, box.width(), 18),
            int(Qt.AlignmentFlag.AlignCenter),
            f"{one.quantity}, {one.unit}",
        )
        painter.drawText(QRectF(box.left() - 44, box.top() - 8, 40, 16), right, f"{most:.0f}")
        painter.drawText(QRectF(box.left() - 44, box.bottom() - 14, 40, 16), right, "0")
