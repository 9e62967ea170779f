"""What the window shows of the organ outside of its views, by a room that it does not import."""

from __future__ import annotations

from importlib import import_module
from typing import Protocol

from PySide6.QtWidgets import QWidget

from palpate.ui.desktop.session.controller import Controller


class OrganPages(Protocol):
    """The probe's window, and what jobs have made."""

    @property
    def touching(self) -> QWidget | None:
        """The probe's window while it is open."""

    @property
    def settled(self) -> bool:
        """Whether that window shows the organ as it is felt."""

    def on_change(self, what: str) -> None:
        """Something has changed: what a job has made is shown, once."""

    def close(self) -> None:
        """Ends the probe."""


def organ_pages(controller: Controller) -> OrganPages:
    """`applications/organ_pages.py`."""
    found: OrganPages = import_module("palpate.applications.organ_pages").OrganPages(controller)
    return found
