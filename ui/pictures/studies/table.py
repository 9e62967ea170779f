"""What is found of a half with a tumour, beside what it has and what the paper found: the pictures of Tables 1 and 2."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from palpate.core.arrays import FloatArray
    from palpate.validate.paper.tumour_tables import TumourRow, TumourTable

OURS, TRUTH, PAPER, OTHER = "#2166ac", "black", "#b2182b", "#7f7f7f"
Key = Literal["clean", "noisy"]
_BY = {"share": "tumour's share of its half, %", "tumour_mu_kpa": "tumour's μ, kPa"}


def study_table(study: TumourTable) -> Figure:
    """One panel without noise, one with; the normal half below the other."""
    figure = Figure(figsize=(8.4, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    scale = 100.0 if study["by"] == "share" else 1.0
    x = np.array([row[study["by"]] for row in study["rows"]]) * scale
    keys: tuple[Key, Key] = ("clean", "noisy")
    for axes, key in zip((left, right), keys, strict=True):
        _references(axes, x, study["rows"])
        _found(axes, x, study["rows"], key, study["correlation"][key])
        axes.set_xlabel(_BY[study["by"]], fontsize=8)
        axes.tick_params(labelsize=7)
        axes.grid(alpha=0.3)
    left.set_title("without noise", fontsize=8)
    right.set_title(f"contours of {study['noise_sd_mm']:g} mm error, with 95 % intervals", fontsize=8)
    left.set_ylabel("μ of a half, kPa (mean of μ1 and μ2)", fontsize=8)
    _from_zero(left, study["rows"], "mu_kpa", "clean")
    _from_zero(right, study["rows"], "ci95_kpa", "noisy")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=7, frameon=False)
    return figure


def _references(axes: Axes, x: FloatArray, rows: list[TumourRow]) -> None:
    has = np.array([row["effective_mu_kpa"] for row in rows])
    place = [row["energy_in_place_mu_kpa"] for row in rows]
    axes.plot(x, has[:, 0], color=TRUTH, linewidth=1.2, label="it has: mean stress over mean strain")
    axes.plot(x, has[:, 1], color=TRUTH, linewidth=1.2, linestyle=":", label="the normal half has")
    axes.plot(
        x, place, color=OTHER, linewidth=1.2, linestyle="--", label="uniform half of the same energy in its place"
    )
    paper = [row["paper"] for row in rows]
    axes.plot(x, [p["tumour"] for p in paper], "x", color=PAPER, markersize=5, label="the paper, tumour's half")
    axes.plot(x, [p["normal"] for p in paper], "+", color=PAPER, markersize=5, label="the paper, normal half")


def _found(axes: Axes, x: FloatArray, rows: list[TumourRow], key: Key, correlation: float) -> None:
    mu, ci = np.array([row[key]["mu_kpa"] for row in rows]), np.array([row[key]["ci95_kpa"] for row in rows])
    for k, (marker, label) in enumerate((("o", "found, tumour's half"), ("s", "found, normal half"))):
        if key == "clean":
            axes.plot(x, mu[:, k], marker, color=OURS, markersize=4, fillstyle=("full", "none")[k], label=label)
        else:
            error = np.abs(ci[:, k] - mu[:, k : k + 1]).T
            axes.errorbar(x, mu[:, k], error, fmt=marker, color=OURS, markersize=4, fillstyle=("full", "none")[k],
                          linewidth=0.8, capsize=2)  # fmt: skip
    axes.annotate(f"correlation {correlation:.4f}", (0.03, 0.95), xycoords="axes fraction", fontsize=7, va="top")


def _from_zero(axes: Axes, rows: list[TumourRow], what: Literal["mu_kpa", "ci95_kpa"], key: Key) -> None:
    """From 0 to a little above the highest of what is found, has been printed or is there."""
    top = max(float(np.max(row["effective_mu_kpa"])) for row in rows)
    found = max(float(np.max(row[key][what])) for row in rows)
    axes.set_ylim(0.0, 1.15 * max(top, found, max(row["paper"]["tumour"] for row in rows)))
