"""The way from two folders to a report: one button a step, and the next one in colour."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtWidgets import QHBoxLayout, QLabel, QPushButton, QVBoxLayout, QWidget

from palpate.ui.desktop import style
from palpate.ui.desktop.session import steps
from palpate.ui.desktop.session.controller import Controller

_SIGNS = {
    steps.DONE: ("\N{CHECK MARK}", style.GOOD),
    steps.OUT_OF_DATE: ("\N{CLOCKWISE OPEN CIRCLE ARROW}", style.WARN),
    steps.READY: ("\N{BLACK RIGHT-POINTING SMALL TRIANGLE}", style.ACCENT),
    steps.CHECKING: ("\N{HORIZONTAL ELLIPSIS}", style.FAINT),
    steps.BLOCKED: ("\N{MIDDLE DOT}", style.FAINT),
}

_WORDS = {steps.BLOCKED: "later"}


class StepBar(QWidget):
    """pressed : called with the command of the step whose button was pressed."""

    def __init__(self, controller: Controller, pressed: Callable[[str], None]) -> None:
        super().__init__()
        self._controller = controller
        self._buttons: dict[str, QPushButton] = {}
        self._notes: dict[str, QLabel] = {}
        row = QHBoxLayout(self)
        row.setContentsMargins(8, 6, 8, 2)
        row.setSpacing(6)
        for number, step in enumerate(steps.STEPS, start=1):
            button = QPushButton(f"{number}  {step.title}")
            button.clicked.connect(lambda _=False, command=step.command: pressed(command))
            note = QLabel()
            column = QVBoxLayout()
            column.setSpacing(1)
            column.addWidget(button)
            column.addWidget(note)
            row.addLayout(column, 1)
            self._buttons[step.command], self._notes[step.command] = button, note
        self.on_change("case")

    def button(self, command: str) -> QPushButton:
        """The button of a step."""
        return self._buttons[command]

    def on_change(self, what: str) -> None:
        """Something has changed."""
        if what not in ("case", "labels", "job", "results", "steps"):
            return
        found = self._controller.steps()
        next_one = steps.next_step(found)
        job = self._controller.jobs.state
        for state in found:
            command = state.step.command
            running = job is not None and job.running and job.step == command
            self._show(state, next_one is not None and next_one.step.command == command, running)

    def _show(self, state: steps.StepState, is_next: bool, running: bool) -> None:
        button, note = self._buttons[state.step.command], self._notes[state.step.command]
        busy = self._controller.jobs.running
        blocked = state.state == steps.BLOCKED
        button.setEnabled(not busy and not blocked)
        why = "a step is running; wait for it or cancel it" if busy else state.reason
        told = why if busy or blocked else f"{state.step.explanation}. {why[:1].upper()}{why[1:]}"
        button.setToolTip(told[:1].upper() + told[1:].rstrip(". ") + ".")
        name = "main" if is_next and not busy else ""
        if button.objectName() != name:
            button.setObjectName(name)
            button.style().unpolish(button)
            button.style().polish(button)
        sign, tone = ("\N{HORIZONTAL ELLIPSIS}", style.ACCENT) if running else _SIGNS[state.state]
        words = "running" if running else ("next" if is_next else _WORDS.get(state.state, state.state))
        optional = (
            " (optional)"
            if state.step.optional and not blocked and state.state not in (steps.DONE, steps.CHECKING)
            else ""
        )
        note.setText(
            f"<span style='color:{tone}'>{sign}</span> <span style='color:{style.FAINT}'>{words}{optional}</span>"
        )
