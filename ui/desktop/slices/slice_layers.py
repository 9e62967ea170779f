"""The layers of one slice view, each kept until what it shows has changed."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar, cast

import numpy as np
from PySide6.QtCore import QPointF
from PySide6.QtGui import QImage, QPainterPath, QPolygonF, qRgba

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.display import WindowLevel, apply_window
from palpate.ui.desktop.slices.overlay import RGBA, outlines
from palpate.ui.desktop.slices.slice_sampling import SampledSlice, cut, is_aligned
from palpate.ui.desktop.slices.slice_viewport import Screen
from palpate.ui.pictures.images import AIR_HU

Layer = TypeVar("Layer")


class Kept:
    """The last value of each layer with what it was made from."""

    def __init__(self) -> None:
        self._made: dict[str, tuple[Hashable, object]] = {}

    def get(self, name: str, key: Hashable, make: Callable[[], Layer]) -> Layer:
        """The kept value where the key is the same, else a new one. A name always stands for values of one type."""
        if name not in self._made or self._made[name][0] != key:
            self._made[name] = (key, make())
        return cast(Layer, self._made[name][1])

    def forget(self) -> None:
        """Drops all."""
        self._made.clear()


def sampled_slice(
    kept: Kept, name: str, volume: Volume, version: int, screen: Screen, position: float
) -> SampledSlice | None:
    """The slice of a volume that a view shows. version : changes when voxels or place of the volume do."""
    oblique = not kept.get(f"{name} aligned", version, lambda: is_aligned(volume))
    region = screen.region() if oblique else None
    labels = volume.array.dtype == np.uint8
    fill = 0.0 if labels else AIR_HU
    key = (version, position, region)
    made: SampledSlice | None = kept.get(
        f"{name} slice", key, lambda: cut(volume, screen.plane, position, fill, labels, region)
    )
    return made


def grey_image(kept: Kept, name: str, sampled: SampledSlice, window: WindowLevel) -> QImage:
    """A slice of HU as grey."""
    return kept.get(f"{name} grey", (id(sampled), window), lambda: _grey(sampled, window))[0]


def label_image(kept: Kept, name: str, sampled: SampledSlice, table: Mapping[int, RGBA]) -> QImage:
    """A slice of labels in colours."""
    key = (id(sampled), tuple(table.items()))
    return kept.get(f"{name} colours", key, lambda: _coloured(sampled, table))[0]


def outline_paths(kept: Kept, name: str, sampled: SampledSlice, labels: tuple[int, ...]) -> dict[int, QPainterPath]:
    """Outlines of labels, with their holes, in mm across and down."""

    def make() -> dict[int, QPainterPath]:
        present = [label for label in labels if (sampled.values == label).any()]
        return {label: _path(outlines(sampled, label)) for label in present}

    made: dict[int, QPainterPath] = kept.get(f"{name} outlines", (id(sampled), labels), make)
    return made


def _grey(sampled: SampledSlice, window: WindowLevel) -> tuple[QImage, LabelArray]:
    data = apply_window(sampled.values, window)
    rows, columns = data.shape
    return QImage(data.data, columns, rows, columns, QImage.Format.Format_Grayscale8), data


def _coloured(sampled: SampledSlice, table: Mapping[int, RGBA]) -> tuple[QImage, LabelArray]:
    data = np.ascontiguousarray(sampled.values, dtype=np.uint8)
    rows, columns = data.shape
    image = QImage(data.data, columns, rows, columns, QImage.Format.Format_Indexed8)
    image.setColorTable([qRgba(*table.get(value, (0, 0, 0, 0))) for value in range(256)])
    return image, data


def _path(lines: list[FloatArray]) -> QPainterPath:
    path = QPainterPath()
    for line in lines:
        path.addPolygon(QPolygonF([QPointF(float(a), float(d)) for a, d in line]))
    return path
