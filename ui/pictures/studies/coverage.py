"""The picture of `validate coverage`: how often the 95 % intervals hold the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from palpate.ui.pictures.studies.axes import OURS, finish, panels

if TYPE_CHECKING:
    from palpate.validate.coverage import CoverageTable


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
