"""The other end of `pipe`: reads messages, those that came together at once, and writes answers."""

from __future__ import annotations

import json
import os
import select
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
    os.dup2(2, 1)  # what libraries print must not come between answers

    def answer(head: Message, data: bytes = b"") -> None:
        _write(out, json.dumps({**head, "bytes": len(data)}).encode() + b"\n" + data)

    rest = b""
    while True:
        read = os.read(0, 1 << 16)
        if not read:
            return 0
        rest += read
        while select.select([0], [], [], 0.0)[0]:
            more = os.read(0, 1 << 16)
            if not more:
                break
            rest += more
        *lines, rest = rest.split(b"\n")
        if lines:
            handle([json.loads(line) for line in lines], answer)


def _write(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]
