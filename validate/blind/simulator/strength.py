"""How strong a hidden effect must be for the organ's surface to show so much of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.core.errors import ConvergenceError

# Solves that the search may take, and how near to what is wanted it ends (a factor).
_TRIES, _NEAR = 4, 1.3
# Where between the weakest and the strongest (logarithms) it begins. What is too strong is found out slowly, by load steps that creep.
_BEGIN = 0.25
# What has no equilibrium is left behind by this share of the way back to what had one; twice at most while nothing had one.
_BACK, _WITHOUT = 0.5, 2
# What shows less than this share of the least that it shall does so in every patient (gravity).
_HOPELESS = 0.1


class TooWeak(Exception):
    """An effect that the scans of this patient cannot show."""


class Hopeless(TooWeak):
    """One that no patient's scans show."""


def strength(
    wanted_mm: float, limits: tuple[float, float], shown_mm: Callable[[float], float], least_mm: float = 0.0
) -> float:
    """Size within limits whose shown_mm is wanted_mm, or the nearest that was found. shown_mm : size -> mm, rising, about a power of it.

    A size at which shown_mm raises ConvergenceError is too strong. Raises ConvergenceError when all are that would show least_mm, and
    TooWeak or Hopeless when even the strongest shows less.
    """
    low, high = np.log(limits)
    least = float(np.log(max(least_mm, 1e-6)))
    found: list[tuple[float, float]] = []  # logarithms of size and of what it shows
    at = low + _BEGIN * (high - low)
    for attempt in range(_TRIES):
        try:
            found.append((at, float(np.log(max(shown_mm(float(np.exp(at))), 1e-6)))))
        except ConvergenceError:
            known = max((size for size, _ in found if size < at), default=low)
            high = at = at - _BACK * (at - known)
            if at - known < 0.1 or (not found and attempt + 1 >= _WITHOUT):
                break
            continue
        off = np.log(wanted_mm) - found[-1][1]
        slope = _slope(found)
        after = float(np.clip(at + off / slope, low, high))
        beyond_reach = found[-1][1] + slope * (high - at) < least
        if beyond_reach or abs(off) < np.log(_NEAR) or abs(after - at) < 0.02:
            break
        at = after
    if not found:
        raise ConvergenceError("no strength of the hidden effect has an equilibrium; make the walls move less")
    size, shown = min(found, key=lambda f: abs(f[1] - np.log(wanted_mm)))
    if shown < least:
        _too_weak(float(np.exp(shown)), least_mm, folds=bool(high < np.log(limits[1])))
    return float(np.exp(size))


def _too_weak(shown_mm: float, least_mm: float, folds: bool) -> None:
    """Raises the reason why no strength shows as much."""
    if shown_mm < _HOPELESS * least_mm:
        raise Hopeless(f"{shown_mm:.3f} mm are left")
    if folds:
        raise ConvergenceError("what shows enough of the hidden effect has no equilibrium; make the walls move less")
    raise TooWeak(f"{shown_mm:.2f} mm are left")


def _slope(found: list[tuple[float, float]]) -> float:
    """Of what is shown in size, both in logarithms; 1 from one point alone, never so flat that a step runs away."""
    if len(found) < 2 or abs(found[-1][0] - found[-2][0]) < 1e-9:
        return 1.0
    return float(np.clip((found[-1][1] - found[-2][1]) / (found[-1][0] - found[-2][0]), 0.25, 3.0))
