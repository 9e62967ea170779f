"""The slice pictures of a case: stiffness on the scan, rest against deformed."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from palpate.imaging.labels import BLADDER, RECTUM
from palpate.ui.pictures.colours import STIFFNESS_LABEL, STIFFNESS_SCALE
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT
from palpate.ui.pictures.planes import AXIAL, PLANES, Plane, Window, reach_of
from palpate.ui.pictures.slice_axes import (
    BONES,
    ORGAN,
    WALLS,
    Outline,
    draw_background,
    draw_outlines,
    draw_place,
    draw_stiffness,
)

DPI = 160
matplotlib.rcParams["font.family"] = "DejaVu Sans"


def stiffness_planes(images: CaseImages) -> Figure:
    """Axial, sagittal and coronal slice through the organ's centre: above the scan, below the stiffness on it."""
    figure = Figure(figsize=(PAGE_INCHES, 5.3), layout="constrained")
    grid = figure.subplots(2, 3)
    met: set[str] = set()
    for column, plane in enumerate(PLANES):
        window = images.window(plane)
        draw_background(grid[0, column], images, plane, window)
        for other in PLANES:
            if other is not plane:
                draw_place(grid[0, column], plane, other, images.window(other))
        met |= _outline_rest(grid[0, column], images, plane, window)
        draw_background(grid[1, column], images, plane, window)
        draw_stiffness(grid[1, column], images, plane, window)
        _outline_rest(grid[1, column], images, plane, window)
        grid[1, column].set_title("")
    _colour_bar(figure, images, list(grid[1]))
    _legend(figure, images, met)
    return figure


def stiffness_series(images: CaseImages, count: int = 6) -> Figure:
    """Axial slices from the organ's lower to its upper end with the stiffness on them."""
    low, high = reach_of(images.rest, images.organ)[:, 2]
    middle = images.window(AXIAL)
    figure = Figure(figsize=(PAGE_INCHES, 5.9), layout="constrained")
    grid = figure.subplots(2, count // 2)
    shares = (np.arange(count) + 0.5) / count
    met: set[str] = set()
    for axes, share in zip(grid.ravel(), shares, strict=True):
        window = replace(middle, centre=(*middle.centre[:2], float(low + share * (high - low))))
        draw_background(axes, images, AXIAL, window)
        draw_stiffness(axes, images, AXIAL, window)
        met |= _outline_rest(axes, images, AXIAL, window)
    _colour_bar(figure, images, list(grid.ravel()))
    _legend(figure, images, met)
    return figure


def deformation_planes(images: CaseImages) -> Figure:
    """Outlines at rest (solid) and deformed (dashed) on the scan at rest. ``images.deformed`` must be there."""
    if images.deformed is None:
        raise ValueError("deformation_planes needs the deformed labels")
    figure = Figure(figsize=(PAGE_INCHES, 3.5), layout="constrained")
    met: set[str] = set()
    for axes, plane in zip(figure.subplots(1, 3), PLANES, strict=True):
        window = images.window(plane, margin_mm=40.0)
        draw_background(axes, images, plane, window)
        for deformed in (False, True):
            met |= draw_outlines(axes, images, plane, window, _outlines(images), deformed)
    _legend(figure, images, met, deformed=True)
    return figure


def stiffness_bar(figure: Figure, axes: list[Axes], shrink: float) -> Colorbar:
    """The colour bar of stiffness beside some axes, its ticks in plain kPa."""
    scale, ticks = STIFFNESS_SCALE, FixedLocator((5.0, 10.0, 20.0, 50.0, 100.0, 200.0))
    bar = figure.colorbar(
        ScalarMappable(scale.norm, scale.colormap),
        ax=axes,
        shrink=shrink,
        pad=0.02,
        aspect=24,
        ticks=ticks,
        extend="both",
    )
    bar.set_label(STIFFNESS_LABEL, fontsize=TEXT)
    bar.ax.tick_params(which="both", labelsize=TEXT)
    bar.ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    return bar


def save(figure: Figure, path: Path) -> Path:
    """Writes a figure as PNG, without the date and the program's name in it."""
    figure.savefig(path, dpi=DPI, format="png", metadata={"Software": None})
    return path


def as_pdf(figure: Figure) -> bytes:
    """The figure as one PDF page, lines and letters as vectors, without the date and the program's name in it."""
    stream = io.BytesIO()
    with matplotlib.rc_context({"pdf.fonttype": 42}):
        figure.savefig(
            stream, dpi=DPI, format="pdf", metadata={"Creator": None, "Producer": None, "CreationDate": None}
        )
    return stream.getvalue()


def _outline_rest(axes: Axes, images: CaseImages, plane: Plane, window: Window) -> set[str]:
    return draw_outlines(axes, images, plane, window, _outlines(images))


def _outlines(images: CaseImages) -> tuple[Outline, ...]:
    walls = tuple(w for w, label in zip(WALLS, (BLADDER, RECTUM), strict=True) if (images.rest.array == label).any())
    return (ORGAN, *walls) if images.ct is not None else (ORGAN, *walls, BONES)


def _colour_bar(figure: Figure, images: CaseImages, axes: list[Axes]) -> None:
    if not images.determined:
        return  # nothing is coloured
    bar = stiffness_bar(figure, axes, 0.95)
    for G in images.determined.values():
        bar.ax.axhline(G, color="white", linewidth=2.4)
        bar.ax.axhline(G, color="black", linewidth=1.2)


def _legend(figure: Figure, images: CaseImages, met: set[str], deformed: bool = False) -> None:
    # Of the outlines that any of the slices meets: an entry without a line is looked for in vain.
    # On paper white lines are nothing: the legend stands on a dark ground, as the outlines do.
    lines = [Line2D([], [], color=o.colour, linewidth=1.4, label=o.name) for o in _outlines(images) if o.name in met]
    if deformed:
        for style, state in (("-", "at rest"), ("--", "deformed")):
            lines.append(Line2D([], [], color="white", linewidth=1.4, linestyle=style, label=state))  # type: ignore[arg-type]
    box = figure.legend(handles=lines, loc="outside lower center", ncols=len(lines), fontsize=TEXT, labelcolor="white")
    box.get_frame().set(facecolor="#303030", edgecolor="none")
