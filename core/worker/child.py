"""Main program of the worker process: read one job, run it, report on standard output."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import sys
import threading
import traceback
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import TracebackType

from palpate.core.errors import Cancelled, InputError, PalpateError
from palpate.core.worker.job import Job
from palpate.core.worker.lifeline import watch
from palpate.core.worker.messages import Message, Reporter, encode


class Channel:
    """Messages as whole lines to a file descriptor, from any thread, with a copy in a file."""

    def __init__(self, descriptor: int, copy: Path) -> None:
        self._descriptor, self._lock = descriptor, threading.Lock()
        self._copy = copy.open("wb", buffering=0)

    def send(self, message: Message) -> None:
        """Send one message. The process ends when the reader has gone."""
        line = encode(message).encode() + b"\n"
        with self._lock:
            self._keep(line)
            try:
                _write_all(self._descriptor, line)
            except BrokenPipeError:
                end_at_once(1)

    def send_last(self, message: Message) -> None:
        """Send the last message from the watching thread; gives up after 0.2 s where another thread is stuck in
        `send`.
        """
        if self._lock.acquire(timeout=0.2):
            line = encode(message).encode() + b"\n"
            self._keep(line)
            _write_all(self._descriptor, line)

    def _keep(self, line: bytes) -> None:
        with contextlib.suppress(OSError):  # the copy is not needed: a full disk must not end the job
            self._copy.write(line)


def main(arguments: list[str]) -> int:
    """Exit status of the job named by the only argument, a job file."""
    descriptor = os.dup(1)
    os.dup2(2, 1)  # text that libraries print must not come between messages
    if len(arguments) != 1:
        raise SystemExit("usage: python -m palpate.core.worker JOB.json")
    try:
        job = Job.load(Path(arguments[0]))
        folder = Path(job.folder)
        channel = _open(descriptor, folder)
    except PalpateError as error:
        _write_all(descriptor, encode(_failure(error)).encode() + b"\n")
        return error.exit_code
    watch(lambda asked: _stop(channel, asked))
    sys.excepthook = lambda kind, error, trace: _internal_error(channel, folder, error, trace)
    return _work(job, channel)


def _work(job: Job, channel: Channel) -> int:
    """Exit status of a job. A Palpate error is an outcome; any other exception is a defect and goes to the exception
    hook.
    """
    channel.send({"type": "started", "kind": job.kind, "process": os.getpid()})
    try:
        result = job.function()(job, Reporter(channel.send))
    except Cancelled:
        channel.send({"type": "cancelled"})
        return Cancelled.exit_code
    except PalpateError as error:
        channel.send(_failure(error))
        return error.exit_code
    except BrokenProcessPool:
        died = PalpateError("a worker process died, perhaps for lack of memory; try again with fewer --workers")
        channel.send(_failure(died))
        return died.exit_code
    channel.send({"type": "result", "result": result})
    return 0


def end_at_once(status: int) -> None:
    """End this process and its pool workers at once, whatever the main thread does. Atomic writes make that safe."""
    for process in multiprocessing.active_children():
        process.kill()
    os._exit(status)


def _open(descriptor: int, folder: Path) -> Channel:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "traceback.txt").unlink(missing_ok=True)
        return Channel(descriptor, folder / "messages.jsonl")
    except OSError as error:
        raise InputError(
            f"{folder}: cannot be written ({error.strerror}); choose another place, or allow writing there"
        ) from error


def _stop(channel: Channel, asked: bool) -> None:
    try:
        if asked:
            channel.send_last({"type": "cancelled"})
    finally:
        end_at_once(Cancelled.exit_code)


def _failure(error: PalpateError) -> Message:
    return {"type": "failed", "reason": " ".join(str(error).split()), "exit_code": error.exit_code}


def _internal_error(channel: Channel, folder: Path, error: BaseException, trace: TracebackType | None) -> None:
    """Report a defect: one line for the user, the traceback in a file. The exception's text, which may hold anything,
    is not in the line.
    """
    path = folder / "traceback.txt"
    with contextlib.suppress(OSError):
        path.write_text("".join(traceback.format_exception(type(error), error, trace)), encoding="utf-8")
    last = traceback.extract_tb(trace)[-1] if trace is not None else None
    place = f" in {Path(last.filename).name}:{last.lineno}" if last is not None else ""
    reason = f"internal error ({type(error).__name__}{place}); the details are in {path}"
    channel.send({"type": "failed", "reason": reason, "exit_code": PalpateError.exit_code})


def _write_all(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]
