"""The bar beside the views that says what a colour stands for: stiffness in kPa, or misfit in mm."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.ticker import LogLocator, MaxNLocator
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QLinearGradient, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from palpate.imaging.labels import BLADDER, BONE, LABEL_COLOURS, LABELS, ORGAN_LABELS, RECTUM
from palpate.ui.desktop import style
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.slices import overlay
from palpate.ui.pictures.colours import STIFFNESS_LABEL

_LISTED = (*ORGAN_LABELS, BLADDER, RECTUM, BONE)
_TOP, _BOTTOM, _LEFT, _WIDE = 34.0, 16.0, 26.0, 16.0


class ColourBar(QWidget):
    """Shows the scale of the overlay that is on; for labels their colours and names."""

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self._controller = controller
        self.setFixedWidth(92)

    def sizeHint(self) -> QSize:
        return QSize(92, 300)

    def told(self, what: str) -> None:
        """Something has changed."""
        shown = self._shows()
        self.setVisible(shown)
        if shown:
            self.update()

    def _shows(self) -> bool:
        case, display = self._controller.case, self._controller.display
        if case is None:
            return False
        if overlay.only_at_rest(display.overlay, display.mode):
            return False
        there = {
            "stiffness": bool(case.regions),
            "map": case.stiffness_map is not None,
            "misfit": case.gap is not None,
            "labels": bool(case.volumes),
        }
        return there.get(display.overlay, False)

    def paintEvent(self, event: QPaintEvent) -> None:
        if not self._shows():
            return
        case, display = self._controller.case, self._controller.display
        assert case is not None
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setFont(QFont("DejaVu Sans", 8))
        if display.overlay == "labels":
            self._legend(
                painter, [label for label in _LISTED if any((v.array == label).any() for v in case.volumes.values())]
            )
        elif display.overlay in ("stiffness", "map"):
            scale = case.scale
            ticks = LogLocator(subs=(1, 2, 5)) if scale.log else MaxNLocator(6)
            shares = {float(v): float(scale.norm(v)) for v in ticks.tick_values(scale.low, scale.high)}
            self._bar(painter, lambda s: QColor.fromRgbF(*scale.colormap(s)[:3]), shares, STIFFNESS_LABEL)
            self._regions(painter, [float(scale.norm(r.G)) for r in case.regions if r.told])
        elif case.gap is not None:
            limit = overlay.residual_limit(case.gap.residual)
            shares = {float(v): (float(v) / limit + 1.0) / 2.0 for v in np.linspace(-limit, limit, 5)}
            name = "gap, mm" if case.gap.diagnosed else "misfit, mm"
            words = f"{name}: model outside (+) or inside (\N{MINUS SIGN}) the scan's organ"
            self._bar(painter, lambda s: QColor.fromRgbF(*colormaps["RdBu_r"](s)[:3]), shares, words)
        painter.end()

    def _legend(self, painter: QPainter, labels: list[int]) -> None:
        for row, label in enumerate(labels):
            y = _TOP + 30.0 * row
            painter.setPen(QPen(QColor(overlay.OUTLINED[label]), 1.3))
            painter.setBrush(QColor(*LABEL_COLOURS[label][:3], 150))
            painter.drawRect(QRectF(2, y, 12, 12))
            painter.setPen(QColor(style.TEXT))
            top = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
            painter.drawText(QRectF(20, y - 1, 70, 28), int(top), LABELS[label].replace("_", "\n"))

    def _bar(self, painter: QPainter, colour_of: object, shares: dict[float, float], words: str) -> None:
        bar = self._rect()
        gradient = QLinearGradient(bar.bottomLeft(), bar.topLeft())
        for share in np.linspace(0.0, 1.0, 33):
            gradient.setColorAt(float(share), colour_of(float(share)))  # type: ignore[operator]
        painter.fillRect(bar, gradient)
        painter.setPen(QPen(QColor(style.FAINT), 1.0))
        painter.drawRect(bar)
        painter.setPen(QColor(style.TEXT))
        for value, share in shares.items():
            if -1e-9 <= share <= 1.0 + 1e-9:
                y = self._y(share)
                painter.drawLine(QPointF(bar.right(), y), QPointF(bar.right() + 4, y))
                side = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
                label = f"{value:g}".replace("-", "\N{MINUS SIGN}")
                painter.drawText(QRectF(bar.right() + 7, y - 8, 44, 16), int(side), label)
        painter.save()
        painter.translate(8.0, bar.center().y())
        painter.rotate(-90.0)
        painter.drawText(QRectF(-200, -8, 400, 16), int(Qt.AlignmentFlag.AlignCenter), words)
        painter.restore()

    def _regions(self, painter: QPainter, shares: list[float]) -> None:
        """A mark at the value of each region."""
        bar = self._rect()
        for share in shares:
            y = self._y(min(max(share, 0.0), 1.0))
            painter.setPen(QPen(QColor("white"), 2.0))
            painter.drawLine(QPointF(bar.left() - 3, y), QPointF(bar.right() + 1, y))

    def _rect(self) -> QRectF:
        return QRectF(_LEFT, _TOP, _WIDE, self.height() - _TOP - _BOTTOM)

    def _y(self, share: float) -> float:
        bar = self._rect()
        return bar.bottom() - share * bar.height()
