"""A pipe that the interpreter writes to as soon as a signal comes, whatever the main thread is doing."""

from __future__ import annotations

import os
import sys


def wake_pipe() -> tuple[int, int]:
    """Its reading end, and the writing end for `signal.set_wakeup_fd`, which asks for one that never blocks, but for Windows."""
    woken, wake = os.pipe()
    if sys.platform != "win32":
        os.set_blocking(wake, False)
    return woken, wake
