"""Calls of the program one after another, moved on by asking: a timer asks in Slicer, a loop asks in tests."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from .process import ProgramCall

RUNNING, DONE, FAILED, CANCELLED = "running", "done", "failed", "cancelled"
_CANCELLED_CODE = 130


@dataclass(frozen=True)
class Step:
    """name : what a person reads. command : its command line. share : of the whole time, for the progress bar. json : whether it is a
    command of the program, which answers in JSON."""

    name: str
    command: Sequence[str]
    share: float = 1.0
    json: bool = True


@dataclass
class Pipeline:
    """steps : what to do. After each ``poll``: state, fraction, message; at the end results by step name, or error.

    log : command lines and what they printed, line by line.
    """

    steps: Sequence[Step]
    state: str = RUNNING
    fraction: float = 0.0
    message: str = ""
    error: str = ""
    results: dict[str, dict[str, Any]] = field(default_factory=dict)
    log: list[str] = field(default_factory=list)
    _index: int = 0
    _call: ProgramCall | None = None
    _heard: int = 0

    def poll(self) -> str:
        """Looks how far the running step is and starts the next one where it has ended; returns the state."""
        if self.state != RUNNING:
            return self.state
        step = self.steps[self._index]
        if self._call is None:
            self.log.append("> " + " ".join(step.command))
            self._call = ProgramCall(step.command, step.json)
            self._heard = 0
        total = sum(s.share for s in self.steps)
        before = sum(s.share for s in self.steps[: self._index])
        self.fraction = (before + step.share * self._call.fraction) / total
        self.message = f"{step.name}: {self._call.message}"
        self._take_log(self._call)
        if not self._call.is_running:
            self._end_step(step, self._call)
        return self.state

    def cancel(self) -> None:
        """Stops at once; no process is left."""
        if self.state == RUNNING:
            self.state, self.message = CANCELLED, "cancelled; what was done is kept"
            if self._call is not None:
                self._call.cancel()

    def wait(self, timeout_s: float = 600.0) -> str:
        """Polls until the end. Raises TimeoutError, after a cancel."""
        end = time.monotonic() + timeout_s
        while self.poll() == RUNNING:
            if time.monotonic() > end:
                self.cancel()
                raise TimeoutError(f"not done after {timeout_s:.0f} s: {self.message}")
            time.sleep(0.05)
        return self.state

    def _take_log(self, call: ProgramCall) -> None:
        """What the running step has printed since the last time."""
        new = call.log[self._heard :]
        self._heard += len(new)
        self.log += new

    def _end_step(self, step: Step, call: ProgramCall) -> None:
        self._take_log(call)
        if call.exit_code == 0:
            self.results[step.name] = call.result()
            self._index, self._call = self._index + 1, None
            if self._index == len(self.steps):
                self.state, self.fraction, self.message = DONE, 1.0, "done"
        elif call.exit_code == _CANCELLED_CODE:
            self.state, self.message = CANCELLED, "cancelled; what was done is kept"
        else:
            self.state, self.error = FAILED, call.error()
            self.message = self.error
