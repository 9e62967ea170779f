"""A process beside the window: JSON lines go to it, JSON lines with bytes after them come back; the window never waits for it.

A message is one line of JSON. An answer is one line of JSON with a key `bytes`, how many bytes follow it.
"""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import sys
import threading
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from palpate.core.worker.executors import ONE_THREAD, cores
from palpate.ui.desktop.solid.pipe_child import Message


@dataclass(frozen=True, eq=False)
class Reply:
    """head : what the line said. data : the bytes after it."""

    head: Message
    data: bytes


class Pipe:
    """module : what `python -m` runs. log : where its standard error goes. over : whether it has ended."""

    def __init__(self, module: str, log: Path) -> None:
        self.over = False
        self._replies: queue.Queue[Reply | None] = queue.Queue()
        self._lines: queue.Queue[bytes | None] = queue.Queue()
        self.log = log
        self._stream = log.open("wb")
        self._child = subprocess.Popen(
            [sys.executable, "-P", "-m", module],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._stream, env=_environment(),
        )  # fmt: skip
        for work in (self._send, self._receive):
            threading.Thread(target=work, daemon=True).start()

    def say(self, **message: object) -> None:
        """Sends one message."""
        self._lines.put(json.dumps(message).encode() + b"\n")

    def replies(self) -> list[Reply]:
        """What has come since the last call."""
        found = []
        with contextlib.suppress(queue.Empty):
            while True:
                came = self._replies.get_nowait()
                if came is None:
                    self.over = True
                else:
                    found.append(came)
        return found

    def close(self) -> None:
        """Ends the process."""
        self._lines.put(None)
        self._child.kill()
        self._child.wait()
        self._stream.close()

    def _send(self) -> None:
        pipe: IO[bytes] | None = self._child.stdin
        assert pipe is not None
        with contextlib.suppress(OSError):  # the process has ended
            while (line := self._lines.get()) is not None:
                pipe.write(line)
                pipe.flush()

    def _receive(self) -> None:
        pipe: IO[bytes] | None = self._child.stdout
        assert pipe is not None
        with contextlib.suppress(OSError, ValueError):
            while line := pipe.readline():
                head = json.loads(line)
                data = pipe.read(head["bytes"])
                if len(data) < head["bytes"]:
                    break
                self._replies.put(Reply(head, data))
        self._replies.put(None)


def _environment() -> dict[str, str]:
    # Without a graphics card Mesa draws with threads that wait for each other, which takes for ever while others use all cores.
    threads = cores() // 2 if cores() > 2 else 0
    return {"LP_NUM_THREADS": str(threads), **os.environ, **ONE_THREAD}
