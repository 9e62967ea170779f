"""One solver as a child process: started with a scene, asked to solve, timed by itself, stopped when it takes too long."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NotRequired, TypedDict, cast

from palpate.core.worker.executors import ONE_THREAD

PEERS = Path(__file__).parent / "peers"


class Failure(TypedDict):
    """A number of load steps that a solver did not arrive with, and why."""

    load_steps: int
    reason: str


class Hello(TypedDict, total=False):
    """A child's first line: seconds of its set-up, and its version."""

    setup_seconds: float
    version: str


class Answer(TypedDict):
    """One solve as the child tells it ("reason" is "" where it arrived), and what the table adds to it.

    load_steps : with how many it arrived, after `failures`. times_our_* : ratios to Palpate.
    largest_difference_relative : from Palpate's solution, relative to the largest displacement.
    """

    reason: str
    seconds: NotRequired[float]
    cpu_seconds: NotRequired[float]
    iterations: NotRequired[int]
    memory_mb: NotRequired[float | None]
    load_steps: NotRequired[int]
    failures: NotRequired[list[Failure]]
    version: NotRequired[str]
    times_our_seconds: NotRequired[float]
    times_our_cpu_seconds: NotRequired[float]
    times_our_seconds_median_of_pairs: NotRequired[float]
    largest_difference_relative: NotRequired[float]


@dataclass(frozen=True)
class ContenderSpec:
    """name : in the table. command : program and arguments before the scene's path; elements : those it has."""

    name: str
    command: tuple[str, ...]
    arguments: tuple[str, ...] = ()
    elements: tuple[str, ...] = ("p1", "p2", "p2p1")
    steps_itself: bool = False


@dataclass
class Contender:
    """A running child. `reason` says why it cannot go on ("" while it can); `died` : it ended by itself."""

    spec: ContenderSpec
    process: subprocess.Popen[str]
    limit_s: float
    reason: str = ""
    died: bool = False
    hello: Hello = field(default_factory=Hello)
    _lines: queue.Queue[str | None] = field(default_factory=queue.Queue)
    _last_error: str = ""
    _listener: threading.Thread | None = None

    @classmethod
    def start(cls, spec: ContenderSpec, scene: Path, limit_s: float) -> Contender:
        """Start the child and let it set up; one thread each, for every contender."""
        process = subprocess.Popen(
            [*spec.command, str(scene), *spec.arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            errors="replace",
            env=_environment(),
            start_new_session=True,
        )
        contender = cls(spec, process, limit_s)
        threading.Thread(target=contender._read, daemon=True).start()
        contender._listener = threading.Thread(target=contender._listen, daemon=True)
        contender._listener.start()
        line = contender._line()
        contender.hello = {} if line is None else json.loads(line)
        return contender

    def solve(self, steps: int, rtol: float, out: Path | None = None) -> Answer:
        """One cold solve: {"reason": "", "seconds", "iterations", "memory_mb"} or a reason why not."""
        if self.reason:
            return {"reason": self.reason}
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(
                json.dumps({"steps": steps, "rtol": rtol, "out": str(out) if out else None}) + "\n"
            )
            self.process.stdin.flush()
        except OSError:  # it has ended; `_answer` says of what
            pass
        return self._answer()

    def stop(self) -> None:
        """End the child and whatever it started."""
        if self.process.poll() is None:  # its id is its own only until it is waited for
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def _answer(self) -> Answer:
        line = self._line()
        return {"reason": self.reason} if line is None else cast(Answer, json.loads(line))

    def _line(self) -> str | None:
        """The child's next line; None, with the reason noted and the child stopped, where none comes."""
        try:
            line = self._lines.get(timeout=self.limit_s)
        except queue.Empty:
            line, self.reason = None, f"no answer within {self.limit_s:g} s"
        else:
            if line is None:
                self.died, self.reason = True, self._last_words()
        if line is None:
            self.stop()
        return line

    def _last_words(self) -> str:
        """How a child that closed its output ended, with the last line that it wrote to standard error."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=5.0)
        code = self.process.poll()
        how = "" if code is None else f", killed by signal {-code}" if code < 0 else f" with status {code}"
        how += " (out of memory?)" if code == -signal.SIGKILL else ""
        if self._listener is not None:
            self._listener.join(timeout=5.0)
        return f"the child process has ended{how}: {self._last_error or 'it wrote no message'}"

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def _listen(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            self._last_error = line.strip()[:200] or self._last_error


def _environment() -> dict[str, str]:
    """One thread; and a peer's script finds its neighbour `protocol` also where PYTHONSAFEPATH keeps its folder away."""
    path = os.pathsep.join(filter(None, (str(PEERS), os.environ.get("PYTHONPATH"))))
    return {**os.environ, **ONE_THREAD, "PYTHONPATH": path}


def solve_with_fewest_steps(contender: Contender, rtol: float, out: Path, steps: Sequence[int]) -> Answer:
    """Full load at once, then in more equal steps until the solver arrives; the failures on the way are part of the answer."""
    failures: list[Failure] = []
    for n in steps[:1] if contender.spec.steps_itself else steps:
        answer = contender.solve(n, rtol, out)
        if answer["reason"] == "":
            return {**answer, "load_steps": n, "failures": failures}
        failures.append({"load_steps": n, "reason": answer["reason"]})
        if contender.reason:
            break
    return {"reason": failures[-1]["reason"], "failures": failures}
