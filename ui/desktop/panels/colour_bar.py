"""The bar beside the views that says what a colour stands for: stiffness in kPa, or misfit in mm."""

from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from palpate.imaging.labels import BLADDER, BONE, LABEL_COLOURS, LABELS, ORGAN_LABELS, RECTUM
from palpate.ui.desktop import style
from palpate.ui.desktop.panels.scale_bar import TOP, WIDTH, draw_bar, draw_stiffness_bar
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.slices import overlay
from palpate.ui.pictures.colours import DISTANCE_MAP, OUTLINES

_LISTED = (*ORGAN_LABELS, BLADDER, RECTUM, BONE)


class ColourBar(QWidget):
    """Shows the scale of the overlay that is on; for labels their colours and names."""

    def __init__(self, controller: Controller) -> None:
        super().__init__()
        self._controller = controller
        self.setFixedWidth(WIDTH)

    def sizeHint(self) -> QSize:
        return QSize(WIDTH, 300)

    def on_change(self, what: str) -> None:
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
                painter,
                [
                    label
                    for label in _LISTED
                    if display.opacity_of(label) > 0.0 and any((v.array == label).any() for v in case.volumes.values())
                ],
            )
        elif display.overlay in ("stiffness", "map"):
            draw_stiffness_bar(
                painter, self.height(), self._controller.scale, [r.G for r in case.regions if r.determined]
            )
        elif case.gap is not None:
            limit = overlay.residual_limit(case.gap.residual)
            shares = {float(v): (float(v) / limit + 1.0) / 2.0 for v in np.linspace(-limit, limit, 5)}
            name = "gap, mm" if case.gap.diagnosed else "misfit, mm"
            words = f"{name}: model outside (+) or inside (\N{MINUS SIGN}) the scan's organ"
            draw_bar(painter, self.height(), lambda s: QColor.fromRgbF(*colormaps[DISTANCE_MAP](s)[:3]), shares, words)
        painter.end()

    def _legend(self, painter: QPainter, labels: list[int]) -> None:
        for row, label in enumerate(labels):
            y = TOP + 30.0 * row
            painter.setPen(QPen(QColor(OUTLINES[label]), 1.3))
            painter.setBrush(QColor(*LABEL_COLOURS[label][:3], 150))
            painter.drawRect(QRectF(2, y, 12, 12))
            painter.setPen(QColor(style.TEXT))
            top = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
            painter.drawText(QRectF(20, y - 1, 70, 28), int(top), LABELS[label].replace("_", "\n"))
