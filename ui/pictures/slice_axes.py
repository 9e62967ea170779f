"""One slice in one set of axes: image, outlines, letters, scale bar, position."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.ui.pictures.colours import OUTLINES, STIFFNESS_SCALE
from palpate.ui.pictures.images import CaseImages, grey, stiffness_slice
from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT
from palpate.ui.pictures.planes import PLANES, Plane, Slice, Window, reached, share_of_label

SCALE_BAR_MM = 20.0
# Its I has serifs: without them it is a stroke like any other.
LETTER_FONT = "DejaVu Sans Mono"
_HALO = [withStroke(linewidth=2.0, foreground="black")]


@dataclass(frozen=True)
class Outline:
    """Labels drawn as one outline; divided : also the line where they meet."""

    name: str
    labels: tuple[int, ...]
    divided: bool = False

    @property
    def colour(self) -> str:
        """Of its line."""
        return OUTLINES[self.labels[0]]


ORGAN = Outline("organ", ORGAN_LABELS, divided=True)
WALLS = (Outline("bladder", (BLADDER,)), Outline("rectum", (RECTUM,)))
BONES = Outline("bone", (BONE,))


def outlined_planes(images: CaseImages, inches: float) -> tuple[Figure, list[tuple[Axes, Plane, Window]]]:
    """A figure of that height, and in it an axial, a sagittal and a coronal slice at rest, organ and walls outlined."""
    figure = Figure(figsize=(PAGE_INCHES, inches), layout="constrained")
    shown = [(axes, plane, images.window(plane)) for axes, plane in zip(figure.subplots(1, 3), PLANES, strict=True)]
    for axes, plane, window in shown:
        draw_background(axes, images, plane, window)
        draw_outlines(axes, images, plane, window, (ORGAN, *WALLS))
    return figure, shown


def draw_background(axes: Axes, images: CaseImages, plane: Plane, window: Window) -> None:
    """CT or labels, letters, scale bar and the slice's position as title; real aspect ratio."""
    picture = grey(images, plane, window)
    axes.imshow(picture.values, extent=picture.extent, interpolation="nearest", aspect="equal")
    axes.set_xlim(picture.extent[0], picture.extent[1])
    axes.set_ylim(picture.extent[2], picture.extent[3])
    axes.set_xticks([])
    axes.set_yticks([])
    axes.set_title(f"{plane.name}\n{position_text(plane, window)}", fontsize=TEXT)
    _letters(axes, plane)
    _scale_bar(axes, picture.extent)


def draw_stiffness(axes: Axes, images: CaseImages, plane: Plane, window: Window, opacity: float = 0.75) -> None:
    """Stiffness colours over the organ; hatched where the pair does not tell it."""
    value, untold = stiffness_slice(images, plane, window)
    scale = STIFFNESS_SCALE
    axes.imshow(
        np.ma.masked_invalid(value.values), extent=value.extent, cmap=scale.colormap, norm=scale.norm, alpha=opacity,
        interpolation="nearest", aspect="equal",
    )  # fmt: skip
    if untold.values.any():
        filled = axes.contourf(*untold.coordinates, untold.values, levels=[0.5, 1.5], colors="none", hatches=["////"])
        filled.set_edgecolor("white")
        filled.set_linewidth(0.0)


def draw_outlines(
    axes: Axes, images: CaseImages, plane: Plane, window: Window, outlines: Iterable[Outline], deformed: bool = False
) -> set[str]:
    """Outlines at the half level of each label, at rest or, dashed, deformed; the names of those that the slice meets.

    Open where the labels or the scan below them end: an organ that is cut off there goes on, and a line would say that it ends.
    """
    labels = images.deformed if deformed and images.deformed is not None else images.rest
    style = "dashed" if deformed else "solid"
    there = reached(labels, plane, window)
    if images.ct is not None:
        there &= reached(images.ct, plane, window)
    met = set()
    for outline in outlines:
        shares = [share_of_label(labels, label, plane, window) for label in outline.labels]
        whole = np.where(there, np.sum([share.values for share in shares], axis=0), np.nan)
        if _line(axes, Slice(whole, shares[0].extent), outline.colour, style, 1.1):
            met.add(outline.name)
        if outline.divided and len(shares) > 1:
            between = np.where(whole > 0.5, shares[0].values - shares[1].values + 0.5, np.nan)
            _line(axes, Slice(between, shares[0].extent), outline.colour, style, 0.7)
    return met


def position_text(plane: Plane, window: Window) -> str:
    """Where the slice lies, in patient coordinates (LPS): ``z = -148.0 mm``.

    Without a letter: the sign tells the side of the scanner's origin, which need not be the side of the patient.
    """
    value = window.centre[plane.normal]
    sign = "\N{MINUS SIGN}" if value < 0 else ""
    return f"{'xyz'[plane.normal]} = {sign}{abs(value):.1f} mm"


def _line(axes: Axes, level: Slice, colour: str, style: str, width: float) -> bool:
    finite = level.values[np.isfinite(level.values)]
    if not finite.size or not finite.min() < 0.5 < finite.max():
        return False
    axes.contour(*level.coordinates, level.values, levels=[0.5], colors=colour, linestyles=style, linewidths=width)
    return True


def _letters(axes: Axes, plane: Plane) -> None:
    places = ((plane.left, 0.03, 0.5), (plane.right, 0.97, 0.5), (plane.top, 0.5, 0.965), (plane.bottom, 0.5, 0.035))
    for letter, x, y in places:
        axes.text(
            x, y, letter, transform=axes.transAxes, color="white", fontsize=TEXT, fontweight="bold", ha="center",
            va="center", path_effects=_HALO, family=LETTER_FONT,
        )  # fmt: skip


def _scale_bar(axes: Axes, extent: tuple[float, float, float, float]) -> None:
    left, right, bottom, top = extent
    x, y = left + 0.06 * (right - left), bottom + 0.06 * (top - bottom)
    axes.plot([x, x + SCALE_BAR_MM], [y, y], color="white", linewidth=2.0, solid_capstyle="butt", path_effects=_HALO)
    axes.text(
        x, y + 0.02 * (top - bottom), f"{SCALE_BAR_MM:.0f} mm", color="white", fontsize=TEXT, va="bottom",
        path_effects=_HALO,
    )  # fmt: skip


def draw_place(axes: Axes, plane: Plane, other: Plane, window: Window) -> None:
    """A thin line where another slice, through the centre of ``window``, cuts this one."""
    place = window.centre[other.normal]
    draw = axes.axvline if other.normal == plane.across else axes.axhline
    draw(place, color="white", linewidth=0.6, linestyle=(0, (1, 3)))


def spread_out(figure: Figure) -> None:
    """Room between views side by side, so that the letters of one are not read as the other's."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.set(wspace=0.14)  # type: ignore[call-arg]
