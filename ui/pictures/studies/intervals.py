"""The pictures of `validate map` and `validate coverage`: which foci the map finds, and how often intervals hold the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from palpate.ui.pictures.studies.axes import OURS, finish, panels

if TYPE_CHECKING:
    from palpate.validate.coverage import CoverageTable
    from palpate.validate.stiffness_map.records import MapTable


_MARKS = ("o", "s", "^", "D")


def study_map(study: MapTable) -> Figure:
    """Left: detection curves, one for each stiffness. Right: shares within one and two standard deviations, what is right in grey."""
    figure, (left, right) = panels(2)
    for times, mark in zip(sorted({row["times"] for row in study["foci"]}), _MARKS, strict=False):
        rows = [row for row in study["foci"] if row["times"] == times]
        found = [100.0 * row["found"] for row in rows]
        left.plot(
            [row["diameter_mm"] for row in rows], found, f"{mark}-", markersize=4, label=f"{times:g} times as stiff"
        )
    left.set_ylim(-3.0, 103.0)
    finish(left, "diameter of the focus, mm", "pairs in which it is told, %")
    for level, low, high in ((68.3, 60.0, 75.0), (95.4, 92.0, 98.0)):
        right.axhspan(low, high, color="0.92", zorder=0)
        right.axhline(level, color="0.6", linewidth=0.8)
    x = np.arange(len(study["cover"]))
    for key, mark, label in (("within_one", "o", "within one sd"), ("within_two", "s", "within two")):
        right.plot(x, [100.0 * row[key] for row in study["cover"]], mark, markersize=5, label=label)  # type: ignore[literal-required]
    right.set_xticks(x, [row["truths"].replace(", ", ",\n") for row in study["cover"]], fontsize=6)
    right.set_ylim(0.0, 103.0)
    finish(right, "", "share of the organ, %")
    return figure


def study_coverage(study: CoverageTable) -> Figure:
    """Left: coverage with its own standard error. Right: how wide the intervals are."""
    figure, (left, right) = panels(2)
    left.axhspan(90.0, 98.0, color="0.92", zorder=0)
    left.axhline(95.0, color="0.6", linewidth=0.8)
    sd = [row["noise_sd_mm"] for row in study["rows"]]
    covered, error = ([100.0 * row[key] for row in study["rows"]] for key in ("covered", "standard_error"))
    left.errorbar(sd, covered, error, fmt="o", color=OURS, markersize=4, capsize=2)
    right.plot(sd, [row["median_width_ln_G"] for row in study["rows"]], "o-", color=OURS, markersize=4)
    left.set_ylim(min(80.0, left.get_ylim()[0]), 100.5)
    right.set_ylim(0.0, None)
    finish(
        left,
        "error of one contour, mm",
        "intervals that hold the truth, %",
        f"{study['replicates']} pairs each",
        legend=False,
    )
    finish(right, "error of one contour, mm", "median width of the interval of ln G", legend=False)
    return figure
