"""The stiffness map on three slices: the map where the scans tell it, and how well it is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from palpate.core.arrays import BoolArray, FloatArray
from palpate.core.identify.map.stiffness_map import nearest_patch, painted
from palpate.ui.pictures.colours import map_scale
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT
from palpate.ui.pictures.planes import PLANES, Plane, Slice, Window, share_of_label
from palpate.ui.pictures.slice_axes import ORGAN, draw_background, draw_outlines
from palpate.ui.pictures.slices import stiffness_bar

Arrays = Mapping[str, NDArray[np.generic]]
_OPACITY = 0.75
_FACTORS = Normalize(1.0, 2.2)


def map_planes(images: CaseImages, arrays: Arrays) -> Figure:
    """Above G in kPa, hatched where the scans tell no more than the smoothness assumed; below the factor within which two of
    three true values lie.

    arrays : of `palpate.core.identify.map.stiffness_map.StiffnessMap`.
    """
    figure = Figure(figsize=(PAGE_INCHES, 5.3), layout="constrained")
    grid = figure.subplots(2, 3)
    scale = images.shared or map_scale(images.stiffness_kpa.values(), arrays)
    for column, plane in enumerate(PLANES):
        window = images.window(plane)
        inside, extent = _inside(images, plane, window)
        G, told = _on(inside, extent, plane, window, lambda at: painted(arrays, at))
        factor, _ = _on(inside, extent, plane, window, lambda at: (_factor(arrays, at), np.ones(len(at), dtype=bool)))
        above, below = grid[:, column]
        for axes in (above, below):
            draw_background(axes, images, plane, window)
        _paint(above, Slice(G, extent), scale.colormap, scale.norm)
        _hatch(above, Slice((inside & ~told).astype(float), extent))
        _paint(below, Slice(factor, extent), "magma_r", _FACTORS)
        for axes in (above, below):
            draw_outlines(axes, images, plane, window, (ORGAN,))
        grid[1, column].set_title("")
    stiffness_bar(figure, list(grid[0]), scale, 0.95)
    bar = figure.colorbar(ScalarMappable(_FACTORS, "magma_r"), ax=list(grid[1]), shrink=0.95, pad=0.02, aspect=24)
    bar.set_label("known to a factor of (1 sd)", fontsize=TEXT)
    bar.ax.tick_params(labelsize=TEXT)
    return figure


def _factor(arrays: Arrays, points: FloatArray) -> FloatArray:
    """exp(sd of ln G) of the nearest patch."""
    return np.asarray(np.exp(np.asarray(arrays["sd"], dtype=float)[nearest_patch(arrays, points)]), dtype=np.float64)


def _inside(images: CaseImages, plane: Plane, window: Window) -> tuple[BoolArray, tuple[float, float, float, float]]:
    shares = [share_of_label(images.rest, label, plane, window) for label in images.organ]
    return np.sum([share.values for share in shares], axis=0) >= 0.5, shares[0].extent


def _on(
    inside: BoolArray,
    extent: tuple[float, float, float, float],
    plane: Plane,
    window: Window,
    values: Callable[[FloatArray], tuple[FloatArray, BoolArray]],
) -> tuple[FloatArray, BoolArray]:
    """Values and marks at the pixels of the organ; NaN and False elsewhere."""
    across, down = Slice(inside.astype(float), extent).coordinates
    rows, columns = np.nonzero(inside)
    points = np.tile(np.array(window.centre, dtype=float), (len(rows), 1))
    points[:, plane.across], points[:, plane.down] = across[columns], down[rows]
    found, marked = values(points)
    out, marks = np.full(inside.shape, np.nan), np.zeros(inside.shape, dtype=bool)
    out[rows, columns], marks[rows, columns] = found, marked
    return out, marks


def _paint(axes: Axes, value: Slice, colours: Colormap | str, norm: Normalize) -> None:
    axes.imshow(
        np.ma.masked_invalid(value.values), extent=value.extent, cmap=colours, norm=norm, alpha=_OPACITY, interpolation="nearest",
        aspect="equal",
    )  # fmt: skip


def _hatch(axes: Axes, untold: Slice) -> None:
    if untold.values.any():
        filled = axes.contourf(*untold.coordinates, untold.values, levels=[0.5, 1.5], colors="none", hatches=["////"])
        filled.set_edgecolor("white")
        filled.set_linewidth(0.0)
