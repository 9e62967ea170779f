"""How wrong each element is, and at what cost: the picture of `palpate validate forward`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypedDict

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

if TYPE_CHECKING:
    from palpate.validate.forward.study import ForwardTable, Row

COLOURS = {"p1": "#b2182b", "p1p1": "#ef8a62", "p2": "#998ec3", "p2p0": "#67a9cf", "p2p1": "#2166ac"}
_GOAL = 1.0  # per cent


class _Style(TypedDict):
    color: str
    label: str
    linewidth: float
    markersize: float


def element_errors(study: ForwardTable) -> Figure:
    """Error of every element by bulk modulus, one panel a way of loading; then error against seconds as the mesh is refined."""
    rows, sizes = study["rows"], study["sizes"]
    drives = list(dict.fromkeys(r["drive"] for r in rows))
    figure = Figure(figsize=(3.2 * (len(drives) + bool(sizes)), 3.2), layout="constrained")
    panels = figure.subplots(1, len(drives) + bool(sizes), squeeze=False)[0]
    for axes, drive in zip(panels, drives, strict=False):
        _by_bulk_modulus(axes, [r for r in rows if r["drive"] == drive])
        axes.set_title(f"{rows[0]['cells']:,} cells, by {drive}", fontsize=8)
    if sizes:
        _by_seconds(panels[-1], sizes)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=7, frameon=False
    )
    return figure


def _by_bulk_modulus(axes: Axes, rows: Sequence[Row]) -> None:
    for element in dict.fromkeys(r["element"] for r in rows):
        chosen = [r for r in rows if r["element"] == element]
        axes.plot([r["ratio"] for r in chosen], [100.0 * r["rms"] for r in chosen], "o-", **_style(element))
    axes.set_xscale("log")
    axes.set_xticks(sorted({r["ratio"] for r in rows}))
    axes.set_xlabel("v1 / μ", fontsize=8)
    _finish(axes)


def _by_seconds(axes: Axes, sizes: Sequence[Row]) -> None:
    for element in dict.fromkeys(r["element"] for r in sizes):
        chosen = [r for r in sizes if r["element"] == element]
        axes.plot([r["cpu_seconds"] for r in chosen], [100.0 * r["rms"] for r in chosen], "o-", **_style(element))
    first = sizes[0]
    axes.set_title(f"refined, v1 / μ = {first['ratio']:g}, by {first['drive']}", fontsize=8)
    axes.set_xscale("log")
    axes.set_xlabel("processor seconds a solve", fontsize=8)
    _finish(axes)


def _style(element: str) -> _Style:
    return {"color": COLOURS.get(element, "black"), "label": element, "linewidth": 1.2, "markersize": 3.5}


def _finish(axes: Axes) -> None:
    axes.set_yscale("log")
    axes.axhline(_GOAL, color="black", linewidth=0.8, linestyle=":")
    axes.set_ylabel("rms error, % of the largest displacement", fontsize=8)
    plain = FuncFormatter(lambda value, _: f"{value:g}")
    axes.xaxis.set_major_formatter(plain)
    axes.yaxis.set_major_formatter(plain)
    axes.tick_params(labelsize=7)
    axes.minorticks_off()
    axes.grid(alpha=0.3)
