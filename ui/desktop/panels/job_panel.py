"""What runs now: step, progress, time left, and the button that stops it."""

from __future__ import annotations

import time

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QLabel, QProgressBar, QPushButton

from palpate.ui.desktop import style
from palpate.ui.desktop.panels.panel_parts import Panel
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.session.jobs import JobState
from palpate.ui.words.number_words import duration

_OUTCOMES = {"done": ("done", style.GOOD), "cancelled": ("cancelled", style.WARN), "failed": ("failed", style.BAD)}


class JobPanel(Panel):
    """Shows the job of the controller, else the reading of scans."""

    def __init__(self, controller: Controller) -> None:
        super().__init__(controller, "Progress")
        form = self.form
        self.title, self.message, self.left = QLabel("Idle"), QLabel(""), QLabel("")
        self.message.setWordWrap(True)
        # Room for two lines from the start, so that nothing below jumps with what is told.
        self.message.setMinimumHeight(2 * self.message.fontMetrics().lineSpacing())
        self.message.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        self.message.setStyleSheet(f"color: {style.FAINT}")
        self.left.setStyleSheet(f"color: {style.FAINT}")
        self.bar = QProgressBar()
        self.bar.setRange(0, 1000)
        self.bar.setFormat("%p %")
        self.bar.setTextVisible(False)
        self.stop = QPushButton("Cancel")
        self.stop.setObjectName("stop")
        self.stop.setShortcut("Esc")
        self.stop.clicked.connect(lambda: controller.cancel())
        row = QHBoxLayout()
        row.addWidget(self.bar, 1)
        row.addWidget(self.stop)
        form.addRow(self.title)
        form.addRow(row)
        form.addRow(self.message)
        form.addRow(self.left)

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what in ("job", "case"):
            self.refresh()

    def refresh(self) -> None:
        """Also called every second, for the time left."""
        controller = self._controller
        job = (
            controller.jobs.state
            if controller.jobs.running or not controller.reader.running
            else controller.reader.state
        )
        busy = controller.jobs.running or controller.reader.running
        self.stop.setEnabled(busy and not controller.jobs.cancelling)
        self.stop.setToolTip("Stop within a second; what is done is kept" if busy else "No step is running")
        if job is None:
            self._clear()
            return
        self.bar.setTextVisible(True)
        self.title.setText(self._title(job))
        done = job.outcome == "done"
        self.bar.setValue(1000 if done else round(1000 * job.step_fraction))
        self.message.setText(job.error or ("" if job.outcome else job.message))
        seconds = job.seconds_left(time.monotonic())
        self.left.setText(time_words(job.seconds_since(time.monotonic()), seconds, bool(job.outcome)))

    def _clear(self) -> None:
        self.title.setText("Idle")
        self.bar.setValue(0)
        self.bar.setTextVisible(False)  # "0 %" would be of nothing
        self.message.clear()
        self.left.clear()

    def _title(self, job: JobState) -> str:
        name = job.name
        if not job.outcome:
            stopping = self._controller.jobs.cancelling
            return f"<b>{name}</b>" + (" (stopping)" if stopping else "")
        words, tone = _OUTCOMES[job.outcome]
        return f"<b>{name}</b> <span style='color:{tone}'>{words}</span>"


def time_words(spent: float, left: float | None, over: bool) -> str:
    """How long it has taken, and how long it will."""
    if over:
        return f"took {duration(spent)}"
    if left is None:
        return f"{duration(spent)} so far"
    rest = "longer than was thought" if left < 1.0 else f"about {duration(left)} left"
    return f"{duration(spent)} so far, {rest}"
