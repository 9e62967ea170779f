"""Force against indentation while one works."""

from __future__ import annotations

from itertools import groupby

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QWidget

from palpate.applications.touch.window.model import TouchModel
from palpate.ui.desktop import style
from palpate.ui.pictures.colours import label_hex

_LEAST_MM, _LEAST_N = 1.0, 0.5
# Answers shown, the last ones: more take longer to draw than the probe takes to answer.
_SHOWN = 3000


class TouchChart(QWidget):
    """A line a touch in the colour of its label, the present place as a ring."""

    def __init__(self, model: TouchModel) -> None:
        super().__init__()
        self.model = model
        self._colours = {name: QColor(label_hex(region)) for region, name in model.body.names.items()}
        self.setMinimumHeight(240)
        self.setAccessibleName("force against indentation")

    def sizeHint(self) -> QSize:
        return QSize(320, 280)

    def paintEvent(self, event: QPaintEvent) -> None:
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(QFont("DejaVu Sans", 7))
        box = QRectF(44, 8, self.width() - 54, self.height() - 44)
        painter.setPen(QPen(QColor(style.LINE), 1.0))
        painter.setBrush(QColor(style.GROUND))
        painter.drawRect(box)
        self._frame(painter, box)
        for _, group in groupby(self.model.curve[-_SHOWN:], key=lambda row: row[0]):
            rows = list(group)
            painter.setPen(QPen(self._colours.get(rows[-1][1], QColor(style.TEXT)), 1.6))
            painter.drawPolyline(QPolygonF([self._at(box, row[2], row[3]) for row in rows]))
        if self.model.curve:
            last = self.model.curve[-1]
            painter.setPen(QPen(QColor(style.TEXT), 1.4))
            painter.setBrush(Qt.BrushStyle.NoBrush)
            painter.drawEllipse(self._at(box, last[2], last[3]), 4.0, 4.0)
        painter.end()

    @property
    def _span(self) -> tuple[float, float, float, float]:
        depths = [row[2] for row in self.model.curve[-_SHOWN:]] or [0.0]
        forces = [row[3] for row in self.model.curve[-_SHOWN:]] or [0.0]
        return min(0.0, *depths, 0.0), max(_LEAST_MM, *depths, 0.0), min(0.0, *forces, 0.0), max(_LEAST_N, *forces, 0.0)

    def _at(self, box: QRectF, depth: float, force: float) -> QPointF:
        left, right, low, high = self._span
        across, up = (depth - left) / (right - left), (force - low) / (high - low)
        return QPointF(box.left() + 6 + across * (box.width() - 12), box.bottom() - 6 - up * (box.height() - 12))

    def _frame(self, painter: QPainter, box: QRectF) -> None:
        left, right, low, high = self._span
        painter.setPen(QPen(QColor(style.LINE), 1.0))
        zero = self._at(box, 0.0, 0.0)
        painter.drawLine(QPointF(box.left(), zero.y()), QPointF(box.right(), zero.y()))
        painter.drawLine(QPointF(zero.x(), box.top()), QPointF(zero.x(), box.bottom()))
        painter.setPen(QColor(style.FAINT))
        below, beside = box.bottom() + 2, box.left() - 62
        painter.drawText(QRectF(box.left(), below, 60, 12), int(Qt.AlignmentFlag.AlignLeft), f"{left:.2g}")
        painter.drawText(QRectF(box.right() - 60, below, 60, 12), int(Qt.AlignmentFlag.AlignRight), f"{right:.2g}")
        painter.drawText(QRectF(beside, box.bottom() - 12, 58, 12), int(Qt.AlignmentFlag.AlignRight), f"{low:.2g}")
        painter.drawText(QRectF(beside, box.top(), 58, 12), int(Qt.AlignmentFlag.AlignRight), f"{high:.2g}")
        painter.drawText(QRectF(box.left(), below + 14, box.width(), 14), int(Qt.AlignmentFlag.AlignCenter),
                         "indentation, mm (negative: pulled)")  # fmt: skip
        painter.save()
        painter.translate(10, box.center().y())
        painter.rotate(-90)
        painter.drawText(QRectF(-60, -7, 120, 14), int(Qt.AlignmentFlag.AlignCenter), "force, N")
        painter.restore()
