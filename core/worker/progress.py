"""How a long step tells what it is doing."""

from __future__ import annotations

from collections.abc import Callable

# Called with the fraction done (0 to 1) and a short line of what is being done.
Progress = Callable[[float, str], None]


def silent(fraction: float, message: str) -> None:
    """A progress that tells nobody."""
