"""What the studies' pictures have in common."""

from __future__ import annotations

from matplotlib.axes import Axes
from matplotlib.figure import Figure

OURS, OTHER, PAPER, TRUTH = "#2166ac", "#ef8a62", "#b2182b", "black"


def panels(count: int, width: float = 3.6, height: float = 3.1) -> tuple[Figure, list[Axes]]:
    """A figure and its panels side by side."""
    figure = Figure(figsize=(width * count, height), layout="constrained")
    return figure, list(figure.subplots(1, count, squeeze=False)[0])


def finish(axes: Axes, x: str, y: str, title: str = "", legend: bool = True) -> None:
    """Small labels, a faint grid."""
    axes.set_xlabel(x, fontsize=8)
    axes.set_ylabel(y, fontsize=8)
    axes.set_title(title, fontsize=8)
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    if legend:
        axes.legend(fontsize=7, framealpha=1.0, edgecolor="0.8")
