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
from typing import Any

from palpate.core.worker.executors import ONE_THREAD

PEERS = Path(__file__).parent / "peers"


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
    """A running child. `reason` says why it cannot go on ("" while it can)."""

    spec: ContenderSpec
    process: subprocess.Popen[str]
    limit_s: float
    reason: str = ""
    hello: dict[str, Any] = field(default_factory=dict)
    _lines: queue.Queue[str | None] = field(default_factory=queue.Queue)

    @classmethod
    def start(cls, spec: ContenderSpec, scene: Path, limit_s: float) -> Contender:
        """Start the child and let it set up; one thread each, for every contender."""
        process = subprocess.Popen(
            [*spec.command, str(scene), *spec.arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,
        )
        contender = cls(spec, process, limit_s)
        threading.Thread(target=contender._read, daemon=True).start()
        contender.hello = contender._answer()
        return contender

    def solve(self, steps: int, rtol: float, out: Path | None = None) -> dict[str, Any]:
        """One cold solve: {"reason": "", "seconds", "iterations", "memory_mb"} or a reason why not."""
        if self.reason:
            return {"reason": self.reason}
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(
                json.dumps({"steps": steps, "rtol": rtol, "out": str(out) if out else None}) + "\n"
            )
            self.process.stdin.flush()
        except OSError:
            self.reason = "the child process has ended"
            return {"reason": self.reason}
        return self._answer()

    def stop(self) -> None:
        """End the child and whatever it started."""
        if self.process.poll() is None:  # its id is its own only until it is waited for
            with contextlib.suppress(ProcessLookupError):
                os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()

    def _answer(self) -> dict[str, Any]:
        try:
            line = self._lines.get(timeout=self.limit_s)
        except queue.Empty:
            line, self.reason = None, f"no answer within {self.limit_s:g} s"
        else:
            self.reason = "" if line else "the child process has ended (out of memory, or an import failed)"
        if line is None:
            self.stop()
            return {"reason": self.reason}
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put(None)


def solve_with_fewest_steps(contender: Contender, rtol: float, out: Path, steps: Sequence[int]) -> dict[str, Any]:
    """Full load at once, then in more equal steps until the solver arrives; the failures on the way are part of the answer."""
    failures: list[dict[str, Any]] = []
    for n in steps[:1] if contender.spec.steps_itself else steps:
        answer = contender.solve(n, rtol, out)
        if answer["reason"] == "":
            return {**answer, "load_steps": n, "failures": failures}
        failures.append({"load_steps": n, "reason": answer["reason"]})
        if contender.reason:
            break
    return {"reason": failures[-1]["reason"], "failures": failures}
