"""The stiffness map within the organ as a layer of a slice view at rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF
from PySide6.QtGui import QImage, QPainterPath, QPolygonF
from skimage import measure

from palpate.core.arrays import FloatArray, IntArray, LabelArray
from palpate.core.identify.map.stiffness_map import called_at
from palpate.imaging.labels import ORGAN_LABELS
from palpate.ui.desktop.session.display import Display
from palpate.ui.desktop.session.map_values import map_at
from palpate.ui.desktop.slices.slice_sampling import SampledSlice
from palpate.ui.pictures.colours import StiffnessScale
from palpate.ui.pictures.planes import Plane

Arrays = Mapping[str, NDArray[np.generic]]


@dataclass(frozen=True, eq=False)
class MapLayer:
    """image : premultiplied colours of the organ's pixels, clear elsewhere. hatched : where the scans do not tell enough, mm
    across and down. stiffer, softer : likewise, places that are told to differ from their half. data : what the image looks at."""

    image: QImage
    hatched: list[QPainterPath]
    stiffer: list[QPainterPath]
    softer: list[QPainterPath]
    data: LabelArray


def map_layer(
    arrays: Arrays, sampled: SampledSlice, plane: Plane, position: float, display: Display, scale: StiffnessScale
) -> MapLayer:
    """The layer over a slice of labels at rest. arrays : of `palpate.core.identify.map.stiffness_map.StiffnessMap`."""
    inside = np.isin(sampled.values, ORGAN_LABELS)
    rows, columns = np.nonzero(inside)
    points = _places(sampled, plane, position, rows, columns)
    halves = sampled.values[rows, columns].astype(np.int64)
    G, told = map_at(arrays, points, display.surest_factor, halves)
    low = -np.inf if display.low_kpa is None else display.low_kpa
    high = np.inf if display.high_kpa is None else display.high_kpa
    shown = told & (low <= G) & (high >= G)
    data = np.zeros((*inside.shape, 4), dtype=np.uint8)
    colours = scale.colormap(scale.norm(G[shown]))
    labels = sampled.values[rows[shown], columns[shown]]
    share = display.opacity * np.array([display.opacity_of(label) for label in range(256)])[labels.astype(int)]
    colours[:, 3] = share
    colours[:, :3] *= share[:, None]
    data[rows[shown], columns[shown]] = np.rint(255.0 * colours)
    sense = called_at(arrays, points, halves)
    hatched, stiffer, softer = (
        _outlines(_pixels(inside.shape, rows[chosen], columns[chosen]), sampled)
        for chosen in (~told, sense > 0, sense < 0)
    )
    height, width = inside.shape
    image = QImage(data.data, width, height, 4 * width, QImage.Format.Format_RGBA8888_Premultiplied)
    return MapLayer(image, hatched, stiffer, softer, data)


def _pixels(shape: tuple[int, ...], rows: IntArray, columns: IntArray) -> FloatArray:
    out = np.zeros(shape)
    out[rows, columns] = 1.0
    return out


def _places(sampled: SampledSlice, plane: Plane, position: float, rows: IntArray, columns: IntArray) -> FloatArray:
    """Patient coordinates (n, 3) mm of pixel centres."""
    left, right, bottom, top = sampled.extent
    height, width = sampled.values.shape
    out = np.full((len(rows), 3), position, dtype=np.float64)
    out[:, plane.across] = left + (columns + 0.5) * (right - left) / width
    out[:, plane.down] = top + (rows + 0.5) * (bottom - top) / height
    return out


def _outlines(inside: FloatArray, sampled: SampledSlice) -> list[QPainterPath]:
    left, right, bottom, top = sampled.extent
    height, width = inside.shape
    paths = []
    for line in measure.find_contours(np.pad(inside, 1), 0.5):
        across = left + (line[:, 1] - 0.5) * (right - left) / width
        down = top + (line[:, 0] - 0.5) * (bottom - top) / height
        path = QPainterPath()
        path.addPolygon(QPolygonF([QPointF(float(a), float(d)) for a, d in zip(across, down, strict=True)]))
        paths.append(path)
    return paths
