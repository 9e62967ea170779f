"""How strong a hidden effect must be for the organ's surface to show so much of it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from palpate.core.errors import ConvergenceError

# Solves that the search may take, and how near to what is wanted it ends (a factor).
_TRIES, _NEAR = 4, 1.3
# Where between the weakest and the strongest (logarithms) it begins. What is too strong is found out slowly, by load steps that creep.
_BEGIN = 0.25
# What has no equilibrium is left behind by this share of the way back to what had one.
_BACK = 0.5


def strength(wanted_mm: float, limits: tuple[float, float], shown_mm: Callable[[float], float]) -> float:
    """Size within limits whose shown_mm is wanted_mm, or the nearest that was found. shown_mm : size -> mm, rising, about a power of it.

    A size at which shown_mm raises ConvergenceError is too strong. Raises ConvergenceError when all are.
    """
    low, high = np.log(limits)
    found: list[tuple[float, float]] = []  # logarithms of size and of what it shows
    at = low + _BEGIN * (high - low)
    for _ in range(_TRIES):
        try:
            found.append((at, float(np.log(max(shown_mm(float(np.exp(at))), 1e-6)))))
        except ConvergenceError:
            known = max((size for size, _ in found if size < at), default=low)
            high = at = at - _BACK * (at - known)
            if at - known < 0.1:
                break
            continue
        off = np.log(wanted_mm) - found[-1][1]
        after = float(np.clip(at + off / _slope(found), low, high))
        if abs(off) < np.log(_NEAR) or abs(after - at) < 0.02:
            break
        at = after
    if not found:
        raise ConvergenceError("no strength of the hidden effect has an equilibrium; make the walls move less")
    return float(np.exp(min(found, key=lambda f: abs(f[1] - np.log(wanted_mm)))[0]))


def _slope(found: list[tuple[float, float]]) -> float:
    """Of what is shown in size, both in logarithms; 1 from one point alone, never so flat that a step runs away."""
    if len(found) < 2 or abs(found[-1][0] - found[-2][0]) < 1e-9:
        return 1.0
    return float(np.clip((found[-1][1] - found[-2][1]) / (found[-1][0] - found[-2][0]), 0.25, 3.0))
