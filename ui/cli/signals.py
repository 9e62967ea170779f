"""Stopping: Ctrl-C and SIGTERM end the command with status 130, and no process stays behind."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Set
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from palpate.core.errors import Cancelled
from palpate.core.worker.wake_pipe import wake_pipe

CANCELLED = "cancelled; run the same command again: what was finished is kept"
EXIT_CODE = 130
# A library written in C may not come back to Python for long; after this the process ends without it.
_GRACE_S = 2.0


@contextmanager
def cancellable() -> Iterator[None]:
    """Within the block SIGTERM and SIGHUP raise Cancelled and Ctrl-C KeyboardInterrupt, or end the process where they cannot."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    woken, wake = wake_pipe()
    old_wake = signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    old = {number: signal.signal(number, _raise) for number in numbers}
    over = threading.Event()
    watch = threading.Thread(target=_watch, args=(woken, over), daemon=True)
    watch.start()
    try:
        yield
    finally:
        over.set()
        for number, handler in old.items():
            signal.signal(number, handler)
        signal.set_wakeup_fd(old_wake)
        os.close(wake)  # the thread reads the end of the pipe and ends
        watch.join(0.5)


@contextmanager
def nothing_left() -> Iterator[None]:
    """Whatever ends the block, the processes that were started in it, and theirs, are killed."""
    before = set(descendants(os.getpid()))
    try:
        yield
    finally:
        end_children(before)


def end_children(spared: Set[int] = frozenset()) -> None:
    """Kills every process that this one has started, and theirs, except the spared ones."""
    for process in set(descendants(os.getpid())) - spared:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.kill(process, signal.SIGKILL)


def descendants(process: int) -> list[int]:
    """Children of a process, their children, and so on."""
    parents = _parents()
    found, new = [], [process]
    while new:
        new = [child for child, parent in parents.items() if parent in new]
        found += new
    return found


def _parents() -> dict[int, int]:
    """Every process of this machine and its parent; none on Windows, where a worker ends when its parent's pipe does."""
    if sys.platform == "win32":
        return {}
    if not Path("/proc/self/stat").exists():
        listed = subprocess.run(["ps", "-A", "-o", "pid=,ppid="], capture_output=True, text=True, check=False).stdout
        return {int(a): int(b) for a, b in (line.split() for line in listed.splitlines())}
    parents = {}
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            with contextlib.suppress(OSError):  # it has ended meanwhile
                # The name in brackets may hold anything; what follows the last bracket is state and parent.
                parents[int(folder.name)] = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
    return parents


def _raise(number: int, frame: FrameType | None) -> None:
    raise Cancelled(CANCELLED)


def _watch(woken: int, over: threading.Event) -> None:
    asked = {signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}
    while received := os.read(woken, 1):
        if received[0] in asked and not over.wait(_GRACE_S):
            end_children()
            print(f"palpate: {CANCELLED}", file=sys.stderr, flush=True)
            os._exit(EXIT_CODE)
    os.close(woken)
