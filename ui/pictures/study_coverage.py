"""The picture of `validate coverage`: how often the 95 % intervals hold the truth."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from palpate.ui.pictures.study_axes import OTHER, OURS, finish, panels

_LOOKS = {"assumed": (OTHER, "s", -0.01), "stated": (OURS, "o", 0.01)}


def study_coverage(study: Mapping[str, Any]) -> Figure:
    """Left: coverage with its own standard error. Right: how wide the intervals are."""
    figure, (left, right) = panels(2)
    left.axhspan(90.0, 98.0, color="0.92", zorder=0)
    left.axhline(95.0, color="0.6", linewidth=0.8)
    for name, (colour, marker, shift) in _LOOKS.items():
        rows = [row for row in study["rows"] if row["noise_model"] == name]
        sd = [row["noise_sd_mm"] for row in rows]
        covered, error = ([100.0 * row[key] for row in rows] for key in ("covered", "standard_error"))
        left.errorbar([s + shift for s in sd], covered, error, fmt=marker, color=colour, markersize=4, capsize=2,
                      label=f"noise {name}")  # fmt: skip
        right.plot(sd, [row["median_width_ln_G"] for row in rows], marker=marker, color=colour, markersize=4,
                   label=f"noise {name}")  # fmt: skip
    left.set_ylim(min(80.0, left.get_ylim()[0]), 100.5)
    right.set_ylim(0.0, None)
    finish(left, "error of one contour, mm", "intervals that hold the truth, %", f"{study['replicates']} pairs each")
    finish(right, "error of one contour, mm", "median width of the interval of ln G", "")
    return figure
