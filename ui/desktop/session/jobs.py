"""The window's side of the worker: start a job, hear its messages without waiting for them, stop it."""

from __future__ import annotations

import contextlib
import queue
import threading
import time
from dataclasses import dataclass, field

from palpate.core.errors import PalpateError
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Message
from palpate.core.worker.process import run_job
from palpate.ui.desktop.session.read_scans import Found
from palpate.ui.desktop.session.steps import BY_COMMAND

# Before this there is nothing to tell the time left from.
_LEAST_SECONDS, _LEAST_FRACTION = 4.0, 0.04


@dataclass
class Swarm:
    """What the swarm has told: best misfit of each iteration heard of, and where its particles are now, (m, t) kPa."""

    iterations: list[int] = field(default_factory=list)
    best: list[float] = field(default_factory=list)
    particles: list[list[float]] = field(default_factory=list)

    def hear(self, message: Message) -> None:
        """Takes a progress message with particles."""
        if not self.iterations or message["iteration"] > self.iterations[-1]:
            self.iterations.append(int(message["iteration"]))
            self.best.append(float(message["best"]))
        self.particles = message["particles"]


@dataclass
class JobState:
    """What is known of the job that runs, or ran last. outcome : "", "done", "cancelled" or "failed".

    found : what progress messages brought along, in their order; whoever uses it takes it out.
    """

    title: str
    began: float
    fraction: float = 0.0
    message: str = "starting"
    step: str = ""
    step_fraction: float = 0.0
    step_began: float = 0.0
    outcome: str = ""
    error: str = ""
    result: dict[str, object] = field(default_factory=dict)
    found: list[Found] = field(default_factory=list)
    swarm: Swarm = field(default_factory=Swarm)
    cancel_seconds: float | None = None
    end_told: float | None = None
    seconds_taken: float | None = None

    @property
    def running(self) -> bool:
        """Whether it has not ended yet."""
        return not self.outcome

    @property
    def name(self) -> str:
        """Of the step that runs, or of the job where it has no steps."""
        return BY_COMMAND[self.step].title if self.step in BY_COMMAND else self.title

    def seconds_left(self, now: float) -> float | None:
        """Of this step, by how fast it went so far; None where that cannot be told yet.

        What a person was told does not grow: a step that turns out longer has 0 s left and goes on.
        """
        spent, fraction = now - self.step_began, self.step_fraction
        if not self.running or spent < _LEAST_SECONDS or fraction < _LEAST_FRACTION:
            return None
        end = now + spent * (1.0 - fraction) / fraction
        self.end_told = end if self.end_told is None else min(end, self.end_told)
        return max(self.end_told - now, 0.0)

    def seconds_since(self, now: float) -> float:
        """Since the job began, or that it took."""
        return now - self.began if self.seconds_taken is None else self.seconds_taken


class JobControl:
    """One job at a time. `poll` is called from the window's own thread and never waits."""

    def __init__(self) -> None:
        self.state: JobState | None = None
        self._messages: queue.Queue[Message] = queue.Queue()
        self._cancel = threading.Event()
        self._asked: float | None = None
        self._thread: threading.Thread | None = None

    @property
    def running(self) -> bool:
        """Whether a job runs."""
        return self.state is not None and self.state.running

    def start(self, job: Job, title: str) -> None:
        """Starts a job; its processes are children of this one and end with it, however it ends."""
        assert not self.running
        now = time.monotonic()
        self.state = JobState(title, now, step_began=now)
        self._cancel, self._messages, self._asked = threading.Event(), queue.Queue(), None
        self._thread = threading.Thread(target=_work, args=(job, self._messages, self._cancel), daemon=True)
        self._thread.start()

    def cancel(self) -> None:
        """Asks the job to stop. When `poll` tells the end, none of its processes is left."""
        if self.running and self._asked is None:
            self._asked = time.monotonic()
            self._cancel.set()

    @property
    def cancelling(self) -> bool:
        """Whether the job was asked to stop and has not ended."""
        return self.running and self._asked is not None

    def poll(self) -> bool:
        """Takes in what the job has told. True when there was something."""
        heard = False
        with contextlib.suppress(queue.Empty):
            while True:
                self._take(self._messages.get_nowait())
                heard = True
        return heard

    def wait(self, seconds: float) -> None:
        """For a window that closes: waits till the job's processes are gone, not longer than given."""
        if self._thread is not None:
            self._thread.join(seconds)

    def _take(self, message: Message) -> None:
        state = self.state
        assert state is not None
        kind = message["type"]
        if kind == "progress":
            step = str(message.get("step", ""))
            if step != state.step:
                state.step, state.step_began, state.end_told = step, time.monotonic(), None
            state.fraction, state.message = float(message["fraction"]), str(message["message"])
            state.step_fraction = float(message.get("step_fraction", state.fraction))
            if "found" in message:
                state.found.append(message["found"])
            if "particles" in message:
                state.swarm.hear(message)
        elif kind == "end":
            state.outcome, state.error, state.result = message["outcome"], message["error"], message["result"]
            state.seconds_taken = message["time"] - state.began
            if self._asked is not None:
                state.cancel_seconds = message["time"] - self._asked


def _work(job: Job, messages: queue.Queue[Message], cancel: threading.Event) -> None:
    """In a thread of its own, which does nothing but wait for the worker's messages."""
    end: Message = {"type": "end", "outcome": "done", "error": "", "result": {}}
    try:
        end["result"] = run_job(job, messages.put, cancel)
    except PalpateError as error:
        end["outcome"] = "cancelled" if cancel.is_set() else "failed"
        end["error"] = "" if cancel.is_set() else " ".join(str(error).split())
    finally:
        end["time"] = time.monotonic()
        messages.put(end)
