"""Progress of a long step."""

from __future__ import annotations

from collections.abc import Callable

# Called with the fraction done (0 to 1) and a short line of what is being done.
Progress = Callable[[float, str], None]


def silent(fraction: float, message: str) -> None:
    """Progress without a listener."""


def part(progress: Progress, low: float, high: float) -> Progress:
    """The progress of a step that is the part from low to high of a longer one."""
    return lambda fraction, message: progress(low + (high - low) * fraction, message)
