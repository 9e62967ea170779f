"""Charts: the swarm while it runs (best misfit so far, where its particles are), and histograms of a label."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from palpate.ui.desktop import style
from palpate.ui.desktop.session.jobs import Swarm
from palpate.ui.desktop.session.labels.label_statistics import Histogram


class SwarmChart(QWidget):
    """Left: best misfit by iteration. Right: particles, stiffness of the first two regions in kPa, logarithmic."""

    def __init__(self) -> None:
        super().__init__()
        self.swarm = Swarm()
        self.bounds_kpa = (5.0, 500.0)
        self.setMinimumHeight(150)
        self.setAccessibleName("swarm")

    def sizeHint(self) -> QSize:
        return QSize(300, 150)

    def show_swarm(self, swarm: Swarm, bounds_kpa: tuple[float, float]) -> None:
        """Draws what has been heard."""
        self.swarm, self.bounds_kpa = swarm, bounds_kpa
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(QFont("DejaVu Sans", 7))
        half = self.width() / 2.0
        self._objective(painter, QRectF(34, 18, half - 42, self.height() - 46))
        self._particles(painter, QRectF(half + 34, 18, half - 42, self.height() - 46))
        painter.end()

    def _objective(self, painter: QPainter, box: QRectF) -> None:
        self._frame(painter, box, "weighted misfit, best so far", "iteration", "")
        best, at = np.array(self.swarm.best), np.array(self.swarm.iterations, dtype=float)
        if not len(best):
            return
        low, high = float(best.min()), float(best.max())
        spread = max(high - low, 1e-9 * max(abs(high), 1.0))
        x = box.left() + (at - at[0]) / max(at[-1] - at[0], 1.0) * box.width()
        y = box.bottom() - 4.0 - (best - low) / spread * (box.height() - 8.0)
        painter.setPen(QPen(QColor(style.ACCENT), 1.8))
        painter.drawPolyline(QPolygonF([QPointF(float(a), float(b)) for a, b in zip(x, y, strict=True)]))
        painter.setBrush(QColor(style.ACCENT))
        painter.drawEllipse(QPointF(float(x[-1]), float(y[-1])), 2.5, 2.5)
        _axis_ends(painter, box, (f"{at[0]:.0f}", f"{at[-1]:.0f}"), (f"{low:.4g}", f"{high:.4g}"))

    def _particles(self, painter: QPainter, box: QRectF) -> None:
        low, high = self.bounds_kpa
        found = np.array(self.swarm.particles, dtype=float)
        two = found.ndim == 2 and found.shape[1] > 1
        self._frame(
            painter, box, "particles", "left half, kPa" if two else "organ, kPa", "right half, kPa" if two else ""
        )
        _axis_ends(painter, box, (f"{low:g}", f"{high:g}"), (f"{low:g}", f"{high:g}") if two else ("", ""))
        if found.ndim != 2 or not found.size:
            return
        share = np.clip(np.log(np.clip(found, low, high) / low) / np.log(high / low), 0.0, 1.0)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(style.colour(style.WARN, 170))
        for row in share:
            y = box.bottom() - (row[1] if two else 0.5) * box.height()
            painter.drawEllipse(QPointF(box.left() + row[0] * box.width(), y), 2.6, 2.6)

    def _frame(self, painter: QPainter, box: QRectF, title: str, across: str, up: str) -> None:
        painter.setPen(QPen(QColor(style.LINE), 1.0))
        painter.setBrush(QColor(style.GROUND))
        painter.drawRect(box)
        painter.setPen(QColor(style.TEXT))
        painter.drawText(QRectF(box.left(), box.top() - 16, box.width(), 14), int(Qt.AlignmentFlag.AlignLeft), title)
        painter.setPen(QColor(style.FAINT))
        painter.drawText(
            QRectF(box.left(), box.bottom() + 12, box.width(), 14), int(Qt.AlignmentFlag.AlignCenter), across
        )
        if up:
            painter.save()
            painter.translate(box.left() - 26, box.center().y())
            painter.rotate(-90)
            painter.drawText(QRectF(-60, -7, 120, 14), int(Qt.AlignmentFlag.AlignCenter), up)
            painter.restore()


def _axis_ends(painter: QPainter, box: QRectF, across: tuple[str, str], up: tuple[str, str]) -> None:
    painter.setPen(QColor(style.FAINT))
    left, right = Qt.AlignmentFlag.AlignLeft, Qt.AlignmentFlag.AlignRight
    painter.drawText(QRectF(box.left(), box.bottom() + 1, 60, 12), int(left), across[0])
    painter.drawText(QRectF(box.right() - 60, box.bottom() + 1, 60, 12), int(right), across[1])
    painter.drawText(QRectF(box.left() - 63, box.bottom() - 12, 60, 12), int(right), up[0])
    painter.drawText(QRectF(box.left() - 63, box.top(), 60, 12), int(right), up[1])


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
