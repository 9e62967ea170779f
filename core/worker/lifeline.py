"""Prompt end of a worker process: on a cancel, and on the death of the process that started it."""

from __future__ import annotations

import ctypes
import os
import signal
import stat
import sys
import threading
from collections.abc import Callable
from types import FrameType

from palpate.core.worker.wake_pipe import wake_pipe

_BELOW_A_WINDOW = 10
_PR_SET_PDEATHSIG = 1


def watch(stop: Callable[[bool], None]) -> None:
    """Call `stop(asked)` from a thread of its own: True after a cancel message, SIGTERM or SIGINT; False when the
    parent has gone.

    Signal handlers run between two Python instructions of the main thread, which may be inside a solver for long. The
    interpreter writes to the wake-up pipe at once.
    """
    woken, wake = wake_pipe()
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, _leave_to_the_thread)
    threading.Thread(target=_wait_for_signal, args=(woken, stop), daemon=True).start()
    if stat.S_ISFIFO(os.fstat(0).st_mode):  # a terminal or /dev/null says nothing about a parent
        die_with_parent()
        threading.Thread(target=_wait_for_message, args=(0, stop), daemon=True).start()


def die_with_parent() -> None:
    """Linux: the kernel kills this process when the thread that started it ends, even while Python code cannot run."""
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)


def give_way() -> None:
    """Lower the priority of this process and its children below that of the window."""
    if hasattr(os, "nice"):
        os.nice(_BELOW_A_WINDOW)


def _wait_for_signal(woken: int, stop: Callable[[bool], None]) -> None:
    os.read(woken, 1)
    stop(True)


def _wait_for_message(source: int, stop: Callable[[bool], None]) -> None:
    """Wait for the parent: any line is a cancel message, the end of the pipe means that the parent has gone."""
    stop(bool(os.read(source, 1)))


def _leave_to_the_thread(number: int, frame: FrameType | None) -> None:
    pass
