"""Where the slice views look: one centre and one magnification for all, so that every view shows the same place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize
from PySide6.QtGui import QTransform

from palpate.core.arrays import FloatArray
from palpate.ui.pictures.planes import Plane


@dataclass
class Viewport:
    """centre (3,) mm LPS in the middle of every view. mm_per_pixel : magnification."""

    centre: FloatArray
    mm_per_pixel: float = 0.5

    def zoom(self, factor: float) -> None:
        """Magnifies; kept between 0.02 and 5 mm a pixel."""
        self.mm_per_pixel = float(np.clip(self.mm_per_pixel / factor, 0.02, 5.0))

    def fit(self, low: FloatArray, high: FloatArray, pixels: int) -> None:
        """Shows a box (mm) whole in views of so many pixels."""
        self.centre = (low + high) / 2.0
        self.mm_per_pixel = float(np.clip((high - low).max() / max(pixels, 50), 0.02, 5.0))


@dataclass(frozen=True)
class Screen:
    """The mapping of one view: plane, viewport and size in pixels. A coordinate across grows to the right; one down grows
    downwards where the plane's down_sign is +1, else upwards."""

    plane: Plane
    viewport: Viewport
    size: QSize

    def to_pixel(self, across: float, down: float) -> QPointF:
        """The pixel of a place in the plane, mm."""
        centre, mm = self.viewport.centre, self.viewport.mm_per_pixel
        x = self.size.width() / 2.0 + (across - centre[self.plane.across]) / mm
        y = self.size.height() / 2.0 + self.plane.down_sign * (down - centre[self.plane.down]) / mm
        return QPointF(x, y)

    def transform(self) -> QTransform:
        """The same mapping for whole paths in mm."""
        origin, scale = self.to_pixel(0.0, 0.0), 1.0 / self.viewport.mm_per_pixel
        return QTransform(scale, 0.0, 0.0, self.plane.down_sign * scale, origin.x(), origin.y())

    def to_mm(self, pixel: QPointF) -> tuple[float, float]:
        """The place in the plane, mm, of a pixel."""
        centre, mm = self.viewport.centre, self.viewport.mm_per_pixel
        across = centre[self.plane.across] + (pixel.x() - self.size.width() / 2.0) * mm
        down = centre[self.plane.down] + self.plane.down_sign * (pixel.y() - self.size.height() / 2.0) * mm
        return float(across), float(down)

    def rect(self, extent: tuple[float, float, float, float]) -> QRectF:
        """Where a picture with an extent (left, right, bottom, top; mm) lies."""
        left, right, bottom, top = extent
        return QRectF(self.to_pixel(left, top), self.to_pixel(right, bottom))

    def region(self, margin_mm: float = 3.0) -> tuple[float, float, float, float]:
        """What is seen: lowest and highest coordinate across and down, mm."""
        a0, d0 = self.to_mm(QPointF(0.0, 0.0))
        a1, d1 = self.to_mm(QPointF(self.size.width(), self.size.height()))
        return a0 - margin_mm, a1 + margin_mm, min(d0, d1) - margin_mm, max(d0, d1) + margin_mm

    def point(self, pixel: QPointF, at: tuple[float, float, float]) -> tuple[float, float, float]:
        """Patient coordinates of a pixel, on the slice through ``at``."""
        out = list(at)
        out[self.plane.across], out[self.plane.down] = self.to_mm(pixel)
        return out[0], out[1], out[2]
