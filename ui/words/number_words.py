"""How a measured number is written: the same on the console, in the window and in the report."""

from __future__ import annotations

import math


def three_figures(value: float) -> str:
    """Three figures, without an exponent."""
    if value == 0.0 or not math.isfinite(value):
        return f"{value:g}"
    places = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{places}f}"


def measured(value: float, sd: float) -> str:
    """A value and its standard deviation, this in two figures and the value as far as that goes."""
    places = max(0, 1 - math.floor(math.log10(sd))) if sd > 0.0 and math.isfinite(sd) else 3
    return f"{value:.{places}f} \N{PLUS-MINUS SIGN} {sd:.{places}f}".replace("-", "\N{MINUS SIGN}")


def duration(seconds: float) -> str:
    """About how long: in steps of five seconds below a minute and a half, then in minutes."""
    if seconds < 90:
        return f"{5 * max(1, round(seconds / 5))} s"
    return f"{round(seconds / 60)} min"
