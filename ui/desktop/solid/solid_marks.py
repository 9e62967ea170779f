"""What both 3D views paint: the picture that a drawing process has answered, and which way the patient lies."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFont, QImage, QPainter, QPen
from PySide6.QtWidgets import QWidget

from palpate.ui.desktop import style
from palpate.ui.desktop.solid.camera import Camera
from palpate.ui.desktop.solid.process_pipe import Reply

_LETTERS = (("L", "R"), ("P", "A"), ("S", "I"))


def image_of(reply: Reply) -> QImage:
    """The picture of an answered view."""
    width, height = reply.head["width"], reply.head["height"]
    # The copy holds its own pixels: QImage does not keep the bytes that it is given.
    return QImage(reply.data, width, height, 3 * width, QImage.Format.Format_RGB888).copy()


def begun(view: QWidget, image: QImage | None) -> QPainter:
    """A painter of a view whose picture, if there is one yet, fills it; `end` it."""
    painter = QPainter(view)
    painter.fillRect(view.rect(), QColor(style.GROUND))
    if image is not None:
        painter.drawImage(view.rect(), image)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    painter.setFont(QFont("DejaVu Sans", 8))
    return painter


def directions(painter: QPainter, camera: Camera, height: int) -> None:
    """Six letters on three lines in the lower left corner of a view of that height, those behind faint."""
    right, up, towards = camera.axes
    middle, length = QPointF(44.0, height - 44.0), 26.0
    for axis in range(3):
        for sign, letter in ((1.0, _LETTERS[axis][0]), (-1.0, _LETTERS[axis][1])):
            v = sign * np.eye(3)[axis]
            front = v @ towards >= -0.05
            painter.setPen(QPen(style.colour(style.TEXT if front else style.FAINT, 255 if front else 120), 1.4))
            painter.drawLine(middle, middle + QPointF(length * (v @ right), -length * (v @ up)))
            tip = middle + QPointF((length + 9) * (v @ right), -(length + 9) * (v @ up))
            painter.drawText(QRectF(tip.x() - 8, tip.y() - 8, 16, 16), int(Qt.AlignmentFlag.AlignCenter), letter)
