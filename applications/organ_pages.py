"""What is shown of the organ outside of the views: the probe's window, and the film of the fall."""

from __future__ import annotations

import tempfile
from pathlib import Path

from PySide6.QtWidgets import QApplication

from palpate.applications.touch.body_file import load_body
from palpate.applications.touch.window.model import TouchModel
from palpate.applications.touch.window.window import TouchWindow
from palpate.ui.desktop.qt_application import events_for
from palpate.ui.desktop.session.controller import Controller
from palpate.ui.desktop.window.outer_pages import show_outside

# As `palpate touch` without options.
_RADIUS_MM = 8.0


class OrganPages:
    """touching : the probe's window while it is open."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._folder = tempfile.TemporaryDirectory(prefix="palpate-touch-")
        self.touching: TouchWindow | None = None

    @property
    def settled(self) -> bool:
        """Whether the probe's window shows the organ as it is felt."""
        return self.touching is not None and self.touching.model.ready and self.touching.view.settled

    def on_change(self, what: str) -> None:
        """Something has changed: what a job has made is shown, once."""
        case = self._controller.case
        if what == "case" and case is None:
            self.close()
        made = self._controller.take_made()
        if "body" in made and case is not None:
            self._touch(made["body"])
        if "film" in made:
            show_outside(self._controller, made["film"])

    def close(self) -> None:
        """Ends the probe."""
        if self.touching is not None:
            self.touching.close()
            self.touching = None

    def _touch(self, file: Path) -> None:
        case, application = self._controller.case, QApplication.instance()
        assert case is not None and isinstance(application, QApplication)
        self.close()
        model = TouchModel(
            load_body(file), _RADIUS_MM, Path(self._folder.name), events_for(application), self._controller.scale
        )
        self.touching = TouchWindow(model, case.folder.file("touch"))
        self.touching.show()
