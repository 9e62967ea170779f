"""How the search for the stiffness went."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT


def convergence(best: Sequence[float], noise: float | None = None) -> Figure:
    """The least objective after each iteration; logarithmic, because the last digits are what matters in the end.

    noise : what noise alone would leave of it on average, a dotted line; None where that is not known.
    """
    figure = Figure(figsize=(0.6 * PAGE_INCHES, 2.4), layout="constrained")
    axes = figure.subplots()
    values = np.asarray(best, dtype=float)
    axes.step(np.arange(1, len(values) + 1), values, where="post", color="#31688e", linewidth=1.5)
    if noise is not None:
        axes.axhline(noise, color="black", linewidth=0.9, linestyle=":")
    if (values > 0).all() and values.max() > 3.0 * values.min():
        axes.set_yscale("log")
    axes.set_xlabel("iteration", fontsize=TEXT)
    axes.set_ylabel("weighted squares,\nleast so far", fontsize=TEXT)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.tick_params(labelsize=TEXT)
    axes.grid(alpha=0.3)
    return figure
