"""The notice that a long step has ended: the window's entry in the task bar asks for attention, the desktop shows a line."""

from __future__ import annotations

from collections.abc import Callable

from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.jobs import JobState

# A step that took less is waited for with the eyes on the window (s).
LONG_S = 20.0


class Notices:
    """tell : called once with the words for every job that ended after LONG_S or more, however it ended."""

    def __init__(self, controller: Controller, tell: Callable[[str], None]) -> None:
        self._controller, self._tell = controller, tell
        self._told: JobState | None = None

    def on_change(self, what: str) -> None:
        """Something has changed."""
        job = self._controller.jobs.state
        if what != "job" or job is None or job.running or job is self._told:
            return
        self._told = job
        if job.outcome != "cancelled" and job.seconds_taken is not None and job.seconds_taken >= LONG_S:
            self._tell(f"{job.name}: {job.outcome}" + (f", {job.error}" if job.error else ""))
