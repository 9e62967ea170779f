"""The picture of `validate resolution`: the paper's Figs 11 and 12."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from palpate.ui.pictures.element_errors import COLOURS
from palpate.ui.pictures.studies.axes import TRUTH, finish, panels

if TYPE_CHECKING:
    from palpate.validate.paper.resolution import ResolutionTable

_LINES = ((0, (1, 1)), ":", "--", "-")


def study_resolution(study: ResolutionTable) -> Figure:
    """Left: error of the normal half. Right: what is found of the tumour's half. A colour an element, a line a mesh."""
    figure, (left, right) = panels(2, 4.4, 3.6)
    share = 100.0 * np.array(study["share"])
    elements = list(dict.fromkeys(row["element"] for row in study["rows"]))
    meshes = sorted({row["nodes"] for row in study["rows"]})
    for row in study["rows"]:
        line = _LINES[meshes.index(row["nodes"]) - len(meshes)]
        label = f"{row['element']}, {row['nodes']} points"
        for axes, values, said in ((left, row["normal_error_percent"], label), (right, row["tumour_mu_kpa"], None)):
            axes.plot(share, values, label=said, color=COLOURS[row["element"]], linestyle=line, linewidth=1.1)
    right.plot(
        share, study["effective_mu_kpa"], "o", color=TRUTH, markersize=3, label="it has: mean stress over mean strain"
    )
    finish(left, "tumour's share of its half, %", "error of the normal half, %", "without noise", legend=False)
    finish(right, "tumour's share of its half, %", "μ found of the tumour's half, kPa", "without noise")
    for axes in (left, right):
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    left.set_ylim(0.05, None)
    left.axhspan(1.0, 5.0, color="0.9", zorder=0)
    left.annotate("the paper: 1 to 5 %", (share[0], 1.05), fontsize=7, color="0.4", va="bottom")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=len(elements), fontsize=6.5,
                  frameon=False)  # fmt: skip
    return figure
