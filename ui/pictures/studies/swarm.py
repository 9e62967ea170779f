"""The picture of `validate swarm`: particles over the objective, the paper's Fig 10."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from palpate.ui.pictures.studies.axes import OURS, PAPER, finish, panels

if TYPE_CHECKING:
    from palpate.validate.paper.swarm import SwarmTable

_TICKS = [5, 20, 100, 500]


def study_swarm(study: SwarmTable) -> Figure:
    """A panel for some iterations: contours of the objective, particles blue, truth red, as in the paper."""
    shown = study["shown"]
    land = shown["landscape"]
    figure, axes = panels(len(shown["iterations"]), 2.7, 3.0)
    height = np.log10(np.maximum(np.array(land["objective"]), 1e-12))
    for k, (panel, iteration) in enumerate(zip(axes, shown["iterations"], strict=True)):
        panel.contour(land["mu_left_kpa"], land["mu_right_kpa"], height, levels=14, cmap="Greys", linewidths=0.7)
        x = np.array(shown["mu_kpa"][k])
        panel.plot(x[:, 0], x[:, 1], ".", color=OURS, markersize=5, label="particles")
        panel.plot(*study["truth_mu_kpa"], "o", color=PAPER, markersize=5, fillstyle="none", label="truth")
        panel.set_xscale("log")
        panel.set_yscale("log")
        for axis in (panel.xaxis, panel.yaxis):
            axis.set_ticks(_TICKS, [str(t) for t in _TICKS])
            axis.set_minor_formatter(NullFormatter())
        finish(
            panel,
            "μ of the left half, kPa",
            "μ of the right half, kPa" if k == 0 else "",
            f"iteration {iteration}",
            k == 0,
        )
    return figure
