"""The other end of `pipe`: reads messages, those that came together at once, and writes answers."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import sys
import threading
from collections.abc import Callable

from palpate.core.worker.lifeline import die_with_parent, give_way
from palpate.core.worker.messages import Message

Answer = Callable[[Message, bytes], None]


def serve(handle: Callable[[list[Message], Answer], None], gives_way: bool) -> int:
    """Calls `handle` with the messages that wait and a function that answers, till standard input ends; 0.

    gives_way : to what a person waits for at the screen.
    """
    die_with_parent()
    if gives_way:
        give_way()
    out = os.dup(1)
    if sys.platform == "win32":
        import msvcrt

        msvcrt.setmode(out, os.O_BINARY)  # line ends are not to be changed within pictures
    os.dup2(2, 1)  # what libraries print must not come between answers

    def answer(head: Message, data: bytes = b"") -> None:
        _write(out, json.dumps({**head, "bytes": len(data)}).encode() + b"\n" + data)

    lines: queue.Queue[bytes | None] = queue.Queue()
    threading.Thread(target=_read, args=(lines,), daemon=True).start()
    while (line := lines.get()) is not None:
        waiting = [line]
        with contextlib.suppress(queue.Empty):
            while (more := lines.get_nowait()) is not None:
                waiting.append(more)
            lines.put(None)  # the end, for the next turn
        handle([json.loads(each) for each in waiting], answer)
    return 0


def _read(lines: queue.Queue[bytes | None]) -> None:
    """In a thread of its own: a pipe cannot be asked on every system whether something waits in it."""
    rest = b""
    while read := os.read(0, 1 << 16):
        *whole, rest = (rest + read).split(b"\n")
        for line in whole:
            lines.put(line)
    lines.put(None)


def _write(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]
