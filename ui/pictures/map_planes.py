"""The stiffness map on three slices: the map where the scans tell it, and how well it is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.identify.map.stiffness_map import called_at, nearest_patch, painted
from palpate.ui.pictures.colours import STIFFNESS_SCALE
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT
from palpate.ui.pictures.planes import PLANES, Plane, Slice, Window, share_of_label
from palpate.ui.pictures.slice_axes import ORGAN, draw_background, draw_outlines
from palpate.ui.pictures.slices import stiffness_bar

Arrays = Mapping[str, NDArray[np.generic]]
Marks = TypeVar("Marks", BoolArray, IntArray)
_OPACITY = 0.75
_FACTORS = Normalize(1.0, 2.2)


def map_planes(images: CaseImages, arrays: Arrays) -> Figure:
    """Above G in kPa, hatched where the scans say less of a deviation from the half's value than the prior does, places that are
    told to be stiffer than their half outlined, softer ones dashed; below the factor within which two of three true values lie.

    arrays : of `palpate.core.identify.map.stiffness_map.StiffnessMap`.
    """
    figure = Figure(figsize=(PAGE_INCHES, 5.3), layout="constrained")
    grid = figure.subplots(2, 3)
    for column, plane in enumerate(PLANES):
        window = images.window(plane)
        labels, extent = _inside(images, plane, window)
        inside = labels > 0
        G, told = _on(labels, extent, plane, window, lambda at, half: painted(arrays, at, half))
        factor, place = _on(
            labels, extent, plane, window, lambda at, half: (_factor(arrays, at, half), called_at(arrays, at, half))
        )
        above, below = grid[:, column]
        for axes in (above, below):
            draw_background(axes, images, plane, window)
        _paint(above, Slice(G, extent), STIFFNESS_SCALE.colormap, STIFFNESS_SCALE.norm)
        _hatch(above, Slice((inside & ~told).astype(float), extent))
        _outline(above, Slice(place.astype(np.float64), extent))
        _paint(below, Slice(factor, extent), "magma_r", _FACTORS)
        for axes in (above, below):
            draw_outlines(axes, images, plane, window, (ORGAN,))
        grid[1, column].set_title("")
    stiffness_bar(figure, list(grid[0]), 0.95)
    bar = figure.colorbar(ScalarMappable(_FACTORS, "magma_r"), ax=list(grid[1]), shrink=0.95, pad=0.02, aspect=24)
    bar.set_label("known to a factor of (1 sd)", fontsize=TEXT)
    bar.ax.tick_params(labelsize=TEXT)
    return figure


def _factor(arrays: Arrays, points: FloatArray, labels: IntArray) -> FloatArray:
    """exp(sd of ln G) of the nearest patch."""
    sd = np.asarray(arrays["sd"], dtype=float)[nearest_patch(arrays, points, labels)]
    return np.asarray(np.exp(sd), dtype=np.float64)


def _inside(images: CaseImages, plane: Plane, window: Window) -> tuple[IntArray, tuple[float, float, float, float]]:
    """Organ labels (rows, columns) of the pixels, 0 outside the organ, and where they lie."""
    shares = [share_of_label(images.rest, label, plane, window) for label in images.organ]
    stack = np.stack([share.values for share in shares])
    most = np.array(images.organ, dtype=np.int64)[stack.argmax(axis=0)]
    return np.where(stack.sum(axis=0) >= 0.5, most, 0), shares[0].extent


def _on(
    labels: IntArray,
    extent: tuple[float, float, float, float],
    plane: Plane,
    window: Window,
    values: Callable[[FloatArray, IntArray], tuple[FloatArray, Marks]],
) -> tuple[FloatArray, Marks]:
    """Values and marks at the pixels of the organ, whose labels are given; NaN and 0 elsewhere."""
    across, down = Slice(labels.astype(float), extent).coordinates
    rows, columns = np.nonzero(labels)
    points = np.tile(np.array(window.centre, dtype=float), (len(rows), 1))
    points[:, plane.across], points[:, plane.down] = across[columns], down[rows]
    found, marked = values(points, labels[rows, columns])
    out, marks = np.full(labels.shape, np.nan), np.zeros(labels.shape, dtype=marked.dtype)
    out[rows, columns], marks[rows, columns] = found, marked
    return out, marks


def _paint(axes: Axes, value: Slice, colours: Colormap | str, norm: Normalize) -> None:
    axes.imshow(
        np.ma.masked_invalid(value.values), extent=value.extent, cmap=colours, norm=norm, alpha=_OPACITY, interpolation="nearest",
        aspect="equal",
    )  # fmt: skip


def _outline(axes: Axes, place: Slice) -> None:
    for sense, line in ((1, "solid"), (-1, "dashed")):
        here = (place.values == sense).astype(float)
        if here.any():
            axes.contour(*place.coordinates, here, levels=[0.5], colors="white", linewidths=1.4, linestyles=line)


def _hatch(axes: Axes, untold: Slice) -> None:
    if untold.values.any():
        filled = axes.contourf(*untold.coordinates, untold.values, levels=[0.5, 1.5], colors="none", hatches=["////"])
        filled.set_edgecolor("white")
        filled.set_linewidth(0.0)
