"""Stiffness found in a pair beside published values, on one logarithmic scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter, NullLocator, ScalarFormatter

from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT
from palpate.ui.words.number_words import three_figures

_ROW_INCHES, _AXIS_INCHES = 0.19, 0.46
_FOUND, _PUBLISHED = "black", "#5a6672"
_TICKS_KPA = tuple(first * 10.0**power for power in range(-3, 6) for first in (1.0, 2.0, 5.0))
# Free to both sides of the outermost value, as a factor; more at the right, where the last value's figure stands.
_FREE = (1.4, 1.7)


@dataclass(frozen=True)
class Row:
    """words : what it is. G : shear modulus, kPa. span : from where to where it reaches, kPa, or None. found : of this pair."""

    words: str
    G: float
    span: tuple[float, float] | None = None
    found: bool = False


def published_scale(rows: Sequence[Row]) -> Figure:
    """One line a row, in their order from above: a dot at G, a bar over its span, the figure beside it."""
    figure = Figure(figsize=(PAGE_INCHES, _ROW_INCHES * len(rows) + _AXIS_INCHES), layout="constrained")
    axes = figure.subplots()
    for place, row in enumerate(rows):
        _draw(axes, -place, row)
    ends = [kpa for row in rows for kpa in (row.G, *(row.span or ()))]
    axes.set_xlim(min(ends) / _FREE[0], max(ends) * _FREE[1])
    axes.set_ylim(0.6 - len(rows), 0.6)
    axes.set_yticks([-place for place in range(len(rows))], [row.words for row in rows], fontsize=TEXT)
    for label, row in zip(axes.get_yticklabels(), rows, strict=True):
        label.set_fontweight("bold" if row.found else "normal")
    kpa_axis(axes)
    axes.tick_params(axis="x", labelsize=TEXT)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel("shear modulus G, kPa", fontsize=TEXT)
    axes.grid(axis="x", alpha=0.35)
    for side in ("top", "left", "right"):
        axes.spines[side].set_visible(False)
    return figure


def kpa_axis(axes: Axes) -> None:
    """Makes the x axis logarithmic in kPa, with round figures written out."""
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(_TICKS_KPA))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_minor_formatter(NullFormatter())


def _draw(axes: Axes, height: int, row: Row) -> None:
    tone = _FOUND if row.found else _PUBLISHED
    last = row.G
    if row.span is not None:
        axes.plot(row.span, (height, height), color=tone, linewidth=2.4 if row.found else 1.2, solid_capstyle="butt")
        last = max(last, row.span[1])
    axes.plot([row.G], [height], marker="s" if row.found else "o", color=tone, markersize=6)
    figure = three_figures(row.G)
    axes.annotate(figure, (last, height), (7, 0), textcoords="offset points", va="center", fontsize=TEXT, color=tone)
