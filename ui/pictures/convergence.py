"""How the search for the stiffness went."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator


def convergence(best: Sequence[float], quantity: str = "best misfit so far,\nweighed by the noise") -> Figure:
    """The best objective after each iteration; logarithmic, because the last digits are what matters in the end."""
    figure = Figure(figsize=(4.6, 2.4), layout="constrained")
    axes = figure.subplots()
    values = np.asarray(best, dtype=float)
    axes.step(np.arange(1, len(values) + 1), values, where="post", color="#31688e", linewidth=1.5)
    if (values > 0).all() and values.max() > 3.0 * values.min():
        axes.set_yscale("log")
    axes.set_xlabel("iteration", fontsize=8)
    axes.set_ylabel(quantity, fontsize=8)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.tick_params(labelsize=7)
    axes.grid(alpha=0.3)
    return figure
