"""The maps of a diagnosis: the residual on the organ in its own standard deviations, and on the slices the residual motion in
and around the organ and the missing force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from palpate.core.arrays import BoolArray, FloatArray, LabelArray
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT
from palpate.ui.pictures.planes import Plane, Window
from palpate.ui.pictures.slice_axes import (
    LETTER_FONT,
    SCALE_BAR_MM,
    outlined_planes,
    spread_out,
)

_LIMIT_SD = 3.0
# Not the colours of the misfit in mm, which this must not be taken for.
_RESIDUAL, _FORCE, _MOTION = "PuOr_r", "autumn", "cool"
# Forces and residual motion within this distance of a slice are shown on it, in squares of this edge, mm.
SLAB_MM, _SQUARE_MM = 7.0, 7.0
# How many times as long as the residual motion its arrow is: a millimetre would hardly be seen.
LONGER = 5.0
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
    View("from the\nfront", (1, -1), (0, 1), "R", "L"),
    View("from\nbehind", (1, 1), (0, -1), "L", "R"),
    View("from the\npatient's left", (0, 1), (1, 1), "A", "P"),
    View("from the\npatient's right", (0, -1), (1, -1), "P", "A"),
)


def residual_views(maps: Mapping[str, FloatArray]) -> Figure:
    """The organ at rest from four sides, superior up; colour: predicted minus seen in standard deviations of the noise.

    maps : points, normals (q, 3), standardised (q,), as `palpate.core.diagnose.verdict.record.maps` gives them.
    """
    figure = Figure(figsize=(PAGE_INCHES, 2.9), layout="constrained")
    axes = list(figure.subplots(1, len(VIEWS)))
    spread_out(figure)
    norm = Normalize(-_LIMIT_SD, _LIMIT_SD)
    points = maps["points"]
    middle, half = 0.5 * (points.min(axis=0) + points.max(axis=0)), 0.62 * float(np.ptp(points, axis=0).max())
    for ax, view in zip(axes, VIEWS, strict=True):
        _seen_from(ax, view, maps, norm)
        _frame(ax, view.across[1] * middle[view.across[0]], middle[2], half)
    _bar(figure, axes, ScalarMappable(norm, _RESIDUAL), "predicted \N{MINUS SIGN} seen (sd)", "both")
    return figure


def force_planes(images: CaseImages, maps: Mapping[str, FloatArray]) -> Figure:
    """Axial, sagittal and coronal slice with the smallest smooth field of forces that would close the gap.

    maps : nodes (k, 3) mm, force_kpa_per_mm (k, 3). Shown in N/cm3, which is kPa/mm.
    """
    figure, shown = outlined_planes(images, 3.4)
    size = np.linalg.norm(maps["force_kpa_per_mm"], axis=1)
    norm = Normalize(0.0, max(float(size.max(initial=0.0)), 1e-9))
    for ax, plane, window in shown:
        _arrows(ax, plane, window, maps, norm)
    axes = [ax for ax, _, _ in shown]
    _bar(figure, axes, ScalarMappable(norm, _FORCE), "missing force (N/cm\N{SUPERSCRIPT THREE})", "neither")
    return figure


def motion_planes(images: CaseImages, maps: Mapping[str, FloatArray]) -> Figure:
    """Axial, sagittal and coronal slice with the plain model's motion minus the matched one, in and around the organ.

    maps : motion/places (w, 3) mm, motion/residual_mm (w, 3), motion/standardised (w, 3). Arrows are `LONGER` times as long as the
    residual; their colour is its size in standard deviations, rms over the axes.
    """
    figure, shown = outlined_planes(images, 3.4)
    norm = Normalize(0.0, _LIMIT_SD)
    places, missed = maps["motion/places"], maps["motion/residual_mm"]
    size = size_in_sd(maps["motion/standardised"])
    for ax, plane, window in shown:
        near = _near(plane, window, places)
        if near.any():
            at, mean = _binned(places[near][:, [plane.across, plane.down]], np.column_stack([missed, size])[near])
            ax.quiver(
                at[:, 0], at[:, 1], mean[:, plane.across], mean[:, plane.down], mean[:, 3], cmap=_MOTION, norm=norm, angles="xy",
                scale_units="xy", scale=1.0 / LONGER, width=0.008,
            )  # fmt: skip
    axes = [ax for ax, _, _ in shown]
    _bar(figure, axes, ScalarMappable(norm, _MOTION), "predicted \N{MINUS SIGN} matched (sd)", "max")
    return figure


def _bar(figure: Figure, axes: list[Axes], colours: ScalarMappable, words: str, extend: str) -> None:
    bar = figure.colorbar(colours, ax=axes, shrink=0.8, extend=extend)
    bar.set_label(words, fontsize=TEXT)
    bar.ax.tick_params(labelsize=TEXT)


def size_in_sd(standardised: FloatArray) -> FloatArray:
    """Size (w,) of differences (w, 3) in standard deviations, rms over the axes."""
    return np.asarray(np.sqrt((standardised**2).mean(axis=1)))


def motion_rgb(size: FloatArray) -> LabelArray:
    """Colours (w, 3) of such sizes (w,), as in `motion_planes`."""
    return np.rint(255.0 * colormaps[_MOTION](np.clip(size / _LIMIT_SD, 0.0, 1.0))[:, :3]).astype(np.uint8)


def _seen_from(ax: Axes, view: View, maps: Mapping[str, FloatArray], norm: Normalize) -> None:
    axis, sign = view.towards
    near = sign * maps["normals"][:, axis] > 0.15
    points = maps["points"][near]
    order = np.argsort(sign * points[:, axis])
    points, value = points[order], maps["standardised"][near][order]
    across, direction = view.across
    ax.scatter(direction * points[:, across], points[:, 2], c=value, cmap=_RESIDUAL, norm=norm, s=9, linewidths=0)
    ax.set_title(view.name, fontsize=TEXT)
    for letter, x, y in ((view.left, 0.03, 0.5), (view.right, 0.97, 0.5), ("S", 0.5, 0.97), ("I", 0.5, 0.03)):
        ax.text(x, y, letter, transform=ax.transAxes, fontsize=TEXT, ha="center", va="center", family=LETTER_FONT)


def _frame(ax: Axes, across: float, up: float, half: float) -> None:
    """The same square in every view, mm, so that all have one scale; its bar at the lower right."""
    ax.set_aspect("equal")
    ax.set_axis_off()
    ax.set_xlim(across - half, across + half)
    ax.set_ylim(up - half, up + half)
    end, y = across + 0.97 * half, up - 0.94 * half
    ax.plot([end - SCALE_BAR_MM, end], [y, y], color="black", linewidth=1.6, solid_capstyle="butt")
    ax.text(end - 0.5 * SCALE_BAR_MM, y, f"{SCALE_BAR_MM:.0f} mm", fontsize=TEXT, ha="center", va="bottom")


def _arrows(ax: Axes, plane: Plane, window: Window, maps: Mapping[str, FloatArray], norm: Normalize) -> None:
    nodes, force = maps["nodes"], maps["force_kpa_per_mm"]
    near = _near(plane, window, nodes)
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


def _near(plane: Plane, window: Window, x: FloatArray) -> BoolArray:
    """Which points (k, 3) mm lie within the slice's slab and its field of view."""
    near = np.abs(x[:, plane.normal] - window.centre[plane.normal]) < SLAB_MM
    return np.asarray(near & (np.abs(x - np.array(window.centre)) < window.half_mm).all(axis=1))


def _binned(at: FloatArray, f: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Means of places (k, 2) and of values (k, c) there over squares."""
    _, group = np.unique(np.floor(at / _SQUARE_MM).astype(int), axis=0, return_inverse=True)
    group = group.ravel()
    count = np.bincount(group)
    mean = np.stack([np.bincount(group, c) / count for c in np.column_stack([at, f]).T], axis=1)
    return mean[:, :2], mean[:, 2:]
