"""The parent's side of a worker process: start, listen, stop, reap."""

from __future__ import annotations

import contextlib
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

from palpate.core.errors import Cancelled, ConvergenceError, InputError, PalpateError
from palpate.core.worker.executors import ONE_THREAD
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message, decode, encode

# Seconds between the request to stop and the kill; a cancel must be done within one second.
_GRACE_SECONDS = 0.6
_POLL_SECONDS = 0.05
# Seconds for killed processes to leave the process table.
_GONE_SECONDS = 0.3
_LAST = ("result", "failed", "cancelled")


def run_job(
    job: Job,
    on_message: Callable[[Message], None] | None = None,
    cancel: threading.Event | None = None,
    python: str = sys.executable,
) -> dict[str, object]:
    """Run a job in a process of its own and return its result.

    on_message : called in this thread with every message, the last one included. cancel : set it from any thread to
    stop. python : the interpreter, where this one is embedded in another program. Postcondition: no process of the job
    is left, also after an exception of on_message or KeyboardInterrupt.

    Raises Cancelled when it was stopped, InputError or ConvergenceError of the job, PalpateError when the process died.
    """
    with _Process(job, python) as process:
        last = _listen(process, on_message, cancel)
        if cancel is not None and cancel.is_set() and last.get("type") != "result":
            raise Cancelled("stopped as asked; run the command again to go on from the last checkpoint")
        status = None if last else process.status()
    if last.get("type") == "result":
        return dict(last["result"])
    raise _error(last, status)


def _listen(process: _Process, on_message: Callable[[Message], None] | None, cancel: threading.Event | None) -> Message:
    """The last message; empty when there was none or the process had to be killed."""
    kill_at = float("inf")
    while time.monotonic() < kill_at:
        if cancel is not None and cancel.is_set() and kill_at == float("inf"):
            kill_at = time.monotonic() + _GRACE_SECONDS
            process.ask_to_stop()
        try:
            message = process.messages.get(timeout=_POLL_SECONDS)
        except queue.Empty:
            continue
        if message is None:
            break
        if on_message is not None:
            on_message(message)
        if message["type"] in _LAST:
            return message
    return {}


def _error(last: Message, status: int | None) -> PalpateError:
    if last.get("type") == "cancelled":
        return Cancelled("stopped from outside; run the command again to go on from the last checkpoint")
    if not last:
        how = f"signal {-status}" if status is not None and status < 0 else f"exit status {status}"
        return PalpateError(
            f"the worker process died ({how}), perhaps for lack of memory; run the command again to go on from the last checkpoint"
        )
    for kind in (InputError, ConvergenceError, Cancelled):
        if kind.exit_code == last["exit_code"]:
            return kind(last["reason"])
    return PalpateError(last["reason"])


class _Process:
    """One worker process in a session of its own, so that it and its pool can be killed together."""

    def __init__(self, job: Job, python: str) -> None:
        folder = Path(job.folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
            job.save(folder / "job.json")
            log = (folder / "worker.log").open("wb")
        except OSError as error:
            raise InputError(
                f"{folder}: cannot be written ({error.strerror}); choose another place, or allow writing there"
            ) from error
        with log:
            self._child = subprocess.Popen(
                [python, "-m", "palpate.core.worker", str(folder / "job.json")],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                env={**os.environ, **ONE_THREAD},
                start_new_session=True,
            )
        self.messages: queue.Queue[Message | None] = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def __enter__(self) -> _Process:
        return self

    def __exit__(self, *_: object) -> None:
        """Kill the process group before its leader is reaped, while its number is not free for others; wait until all
        have ended.
        """
        if sys.platform == "win32":
            self._child.kill()
            self._child.wait()
        else:
            _signal_group(self._child.pid, signal.SIGKILL)
            self._child.wait()
            give_up = time.monotonic() + _GONE_SECONDS
            while _signal_group(self._child.pid, 0) and time.monotonic() < give_up:
                time.sleep(0.005)
        assert self._child.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._child.stdin.close()

    def ask_to_stop(self) -> None:
        """Send the cancel message."""
        assert self._child.stdin is not None
        with contextlib.suppress(BrokenPipeError):  # it ended by itself in the meantime
            self._child.stdin.write(encode({"type": "cancel"}).encode() + b"\n")
            self._child.stdin.flush()

    def status(self) -> int | None:
        """Exit status of a process that closed its end of the pipe, or None when it still runs after a while."""
        try:
            return self._child.wait(timeout=_GRACE_SECONDS)
        except subprocess.TimeoutExpired:
            return None

    def _read(self) -> None:
        assert self._child.stdout is not None
        with self._child.stdout as stream:
            for line in stream:
                message = decode(line)
                if message is not None:
                    self.messages.put(message)
        self.messages.put(None)


def _signal_group(group: int, number: int) -> bool:
    """Whether there was anybody to send the signal to."""
    try:
        os.killpg(group, number)
    except ProcessLookupError:
        return False
    return True
