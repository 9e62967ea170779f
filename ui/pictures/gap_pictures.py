"""The maps of a diagnosis: the residual on the organ in its own standard deviations, the missing force on the slices."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.planes import PLANES, Plane, Window
from palpate.ui.pictures.slice_axes import (
    LETTER_FONT,
    ORGAN,
    SCALE_BAR_MM,
    WALLS,
    draw_background,
    draw_outlines,
    spread_out,
)

FloatArray = NDArray[np.float64]

_LIMIT_SD = 3.0
_RESIDUAL, _FORCE = "RdBu_r", "autumn"
# Forces within this distance of a slice are shown on it, in squares of this edge, mm.
_SLAB_MM, _SQUARE_MM = 7.0, 7.0
# Forces below this share of the largest are left out: arrows everywhere would hide the anatomy.
_SHOWN = 0.2


@dataclass(frozen=True)
class View:
    """The organ as seen from one side: towards (the viewer), across and up the screen, as patient axes with signs."""

    name: str
    towards: tuple[int, int]
    across: tuple[int, int]
    left: str
    right: str


VIEWS = (
    View("from the front", (1, -1), (0, 1), "R", "L"),
    View("from behind", (1, 1), (0, -1), "L", "R"),
    View("from the patient's left", (0, 1), (1, 1), "A", "P"),
    View("from the patient's right", (0, -1), (1, -1), "P", "A"),
)


def residual_views(maps: Mapping[str, FloatArray]) -> Figure:
    """The organ at rest from four sides, superior up; colour: predicted minus seen in standard deviations of the noise.

    maps : points, normals (q, 3), standardised (q,), as `palpate.core.gap.record.maps` gives them.
    """
    figure = Figure(figsize=(7.6, 2.6), layout="constrained")
    axes = list(figure.subplots(1, len(VIEWS)))
    spread_out(figure)
    norm = Normalize(-_LIMIT_SD, _LIMIT_SD)
    for ax, view in zip(axes, VIEWS, strict=True):
        _seen_from(ax, view, maps, norm)
    bar = figure.colorbar(ScalarMappable(norm, _RESIDUAL), ax=axes, shrink=0.8, extend="both")
    bar.set_label("predicted \N{MINUS SIGN} seen (sd)", fontsize=7)
    bar.ax.tick_params(labelsize=6)
    return figure


def force_planes(images: CaseImages, maps: Mapping[str, FloatArray]) -> Figure:
    """Axial, sagittal and coronal slice with the smallest smooth field of forces that would close the gap.

    maps : nodes (k, 3) mm, force_kpa_per_mm (k, 3). Shown in N/cm3, which is kPa/mm.
    """
    figure = Figure(figsize=(7.6, 3.0), layout="constrained")
    axes = list(figure.subplots(1, 3))
    size = np.linalg.norm(maps["force_kpa_per_mm"], axis=1)
    norm = Normalize(0.0, max(float(size.max(initial=0.0)), 1e-9))
    for ax, plane in zip(axes, PLANES, strict=True):
        window = images.window(plane)
        draw_background(ax, images, plane, window)
        draw_outlines(ax, images.rest, plane, window, (ORGAN, *WALLS))
        _arrows(ax, plane, window, maps, norm)
    bar = figure.colorbar(ScalarMappable(norm, _FORCE), ax=axes, shrink=0.8)
    bar.set_label("missing force (N/cm\N{SUPERSCRIPT THREE})", fontsize=7)
    bar.ax.tick_params(labelsize=6)
    return figure


def _seen_from(ax: Axes, view: View, maps: Mapping[str, FloatArray], norm: Normalize) -> None:
    axis, sign = view.towards
    near = sign * maps["normals"][:, axis] > 0.15
    points = maps["points"][near]
    order = np.argsort(sign * points[:, axis])
    points, value = points[order], maps["standardised"][near][order]
    across, direction = view.across
    ax.scatter(direction * points[:, across], points[:, 2], c=value, cmap=_RESIDUAL, norm=norm, s=9, linewidths=0)
    ax.set_aspect("equal")
    ax.set_xticks([])
    ax.set_yticks([])
    ax.margins(0.16)
    ax.set_title(view.name, fontsize=7)
    for letter, x, y in ((view.left, 0.06, 0.5), (view.right, 0.94, 0.5), ("S", 0.5, 0.95), ("I", 0.5, 0.05)):
        ax.text(x, y, letter, transform=ax.transAxes, fontsize=8, ha="center", va="center", family=LETTER_FONT)
    _scale_bar(ax)


def _scale_bar(ax: Axes) -> None:
    """At the lower right; the axes are in mm."""
    (left, right), (bottom, top) = ax.get_xlim(), ax.get_ylim()
    ax.set_xlim(left, right)
    ax.set_ylim(bottom, top)
    end, y = right - 0.03 * (right - left), bottom + 0.03 * (top - bottom)
    ax.plot([end - SCALE_BAR_MM, end], [y, y], color="black", linewidth=1.6, solid_capstyle="butt")
    ax.text(end - 0.5 * SCALE_BAR_MM, y, f"{SCALE_BAR_MM:.0f} mm", fontsize=5.5, ha="center", va="bottom")


def _arrows(ax: Axes, plane: Plane, window: Window, maps: Mapping[str, FloatArray], norm: Normalize) -> None:
    nodes, force = maps["nodes"], maps["force_kpa_per_mm"]
    near = np.abs(nodes[:, plane.normal] - window.centre[plane.normal]) < _SLAB_MM
    near &= (np.abs(nodes - np.array(window.centre)) < window.half_mm).all(axis=1)
    if not near.any():
        return
    at, f = _binned(nodes[near][:, [plane.across, plane.down]], force[near])
    size = np.linalg.norm(f, axis=1)
    shown = size > _SHOWN * norm.vmax if norm.vmax else np.zeros(len(size), dtype=bool)
    at, f, size = at[shown], f[shown], size[shown]
    ax.quiver(
        at[:, 0], at[:, 1], f[:, plane.across], f[:, plane.down], size, cmap=_FORCE, norm=norm, angles="xy",
        scale_units="xy", scale=float(norm.vmax or 1.0) / (2.0 * _SQUARE_MM), width=0.008,
    )  # fmt: skip


def _binned(at: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Means of places (k, 2) and forces (k, 3) over squares."""
    _, group = np.unique(np.floor(at / _SQUARE_MM).astype(int), axis=0, return_inverse=True)
    group = group.ravel()
    count = np.bincount(group)
    mean = np.stack([np.bincount(group, c) / count for c in np.column_stack([at, f]).T], axis=1)
    return mean[:, :2], mean[:, 2:]
