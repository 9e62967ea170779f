"""What the parts of the controller see of it: the open case, how it is shown, what runs, and whom they tell of changes."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.display import Display
from palpate.ui.desktop.session.jobs import JobControl
from palpate.ui.desktop.session.open_case import OpenCase


class Session(Protocol):
    """case : the open case or None. jobs : the steps. available : commands of this version.

    made : what a job has made outside of the case and nobody has shown yet: a body to touch, a film.
    """

    case: OpenCase | None
    display: Display
    jobs: JobControl
    available: frozenset[str]
    made: dict[str, Path]

    @property
    def reader(self) -> JobControl:
        """Reading of scans and labels."""

    def notify(self, what: str) -> None:
        """Tells the listeners that something has changed."""

    def say(self, text: str) -> None:
        """Tells a person something."""

    def ct(self, state: str) -> Volume | None:
        """The CT of a state in the rest frame, as far as it is read."""

    def labels(self, state: str) -> Volume | None:
        """The label volume of a state, with all corrections; None where there is none yet."""

    def out_of_date(self, command: str) -> str:
        """Why what a step has made is out of date; empty where it is not."""

    def save(self) -> None:
        """Writes corrected labels into the case."""

    def go_on(self) -> None:
        """Runs the steps that were asked for when the case was opened, once."""

    def take_in(self, done: bool, labels: bool) -> str:
        """Reads what a job has written; in words, where there is something to say. Raises InputError for damaged files."""
