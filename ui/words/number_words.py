"""How a measured number is written: the same on the console, in the window and in the report."""

from __future__ import annotations

import numpy as np


def three_figures(value: float) -> str:
    """Three figures, without an exponent."""
    if value == 0.0 or not np.isfinite(value):
        return f"{value:g}"
    places = max(0, 2 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{places}f}"


def measured(value: float, sd: float) -> str:
    """A value and its standard deviation, this in two figures and the value as far as that goes."""
    places = max(0, 1 - int(np.floor(np.log10(sd)))) if sd > 0.0 and np.isfinite(sd) else 3
    return f"{value:.{places}f} \N{PLUS-MINUS SIGN} {sd:.{places}f}".replace("-", "\N{MINUS SIGN}")
