"""What the window asks before work would be lost."""

from __future__ import annotations

from PySide6.QtWidgets import QMessageBox, QWidget

from palpate.ui.desktop.session import steps
from palpate.ui.desktop.session.controller import Controller

_ASKS = QMessageBox.StandardButton


def may_run(window: QWidget, controller: Controller, command: str) -> bool:
    """Whether a step may begin: segmenting again replaces corrections made by hand."""
    case = controller.case
    if command != "segment" or case is None or not (case.corrections.can_undo or case.corrections.unsaved):
        return True
    asked = QMessageBox.question(
        window, "Segment again?", "The labels contain corrections made by hand. Segmenting again with other points replaces them; "
        "a copy is kept in the case folder. Go on?",
    )  # fmt: skip
    return asked == _ASKS.Yes


def may_close(window: QWidget, controller: Controller) -> bool:
    """Whether the window may close; unsaved corrections are saved or discarded as was answered."""
    if controller.jobs.running:
        name = steps.BY_COMMAND.get(controller.jobs.state.step if controller.jobs.state else "")
        words = f"{name.title if name else 'A step'} is running and will be stopped. Close?"
        if QMessageBox.question(window, "Close?", words) != _ASKS.Yes:
            return False
    case = controller.case
    if case is None or not case.corrections.unsaved:
        return True
    asked = QMessageBox.question(
        window, "Unsaved corrections", "Save the corrected labels before closing?",
        _ASKS.Save | _ASKS.Discard | _ASKS.Cancel, _ASKS.Save,
    )  # fmt: skip
    if asked == _ASKS.Save:
        controller.save()
    elif asked == _ASKS.Discard:
        case.discard()
    return bool(asked != _ASKS.Cancel)
