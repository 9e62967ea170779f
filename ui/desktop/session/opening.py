"""Opening two scans, or a case: what is read in the worker, and the import that makes a case of a pair."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from palpate.case.case_folder import STATES
from palpate.core.errors import InputError
from palpate.imaging.scans.scan import is_ct
from palpate.ui.desktop.session import read_scans, step_job, steps
from palpate.ui.desktop.session.crosshair import first_place
from palpate.ui.desktop.session.jobs import JobControl
from palpate.ui.desktop.session.read_scans import Found, Offered, Scan, mapped_labels, mapped_scan
from palpate.ui.desktop.session.session import Session
from palpate.ui.desktop.session.step_requests import import_request

# Files with contours of the scan at rest and of the deformed one.
Labels = tuple[Path | None, Path | None]
# Organ -> structures of a file.
Rois = Mapping[str, Sequence[str]]


@dataclass(frozen=True)
class ScanPair:
    """Two scans, the case that is to be made of them, and contours of them where there are any.

    series, rois : what a person has chosen of each state where there were several. then : steps that follow the import.
    """

    rest: Path
    deformed: Path
    case: Path
    labels: Labels
    series: Mapping[str, str] = field(default_factory=dict)
    rois: Mapping[str, Rois] = field(default_factory=dict)
    then: tuple[str, ...] = ()

    def check(self) -> None:
        """Raises InputError for paths that are not there."""
        for path in self.labels:
            if path is not None and not path.is_file():
                raise InputError(f"{path} is not there; choose the file that holds the contours")
        for path in (self.rest, self.deformed):
            if not path.exists():
                raise InputError(f"{path} is not there; choose the folder that holds the slices of the CT")


class Opening:
    """reader : the job that reads scans and labels. scans : what has been read. pair : of which a case is being made, if any.
    offered : what a person must choose before it is made."""

    def __init__(self, session: Session) -> None:
        self._session = session
        self.reader = JobControl()
        self.scans: dict[str, Scan] = {}
        self.pair: ScanPair | None = None
        self.offered: Offered | None = None
        self._scratch = Path(tempfile.mkdtemp(prefix="palpate-window-"))
        self._number = 0

    def forget(self) -> None:
        """What has been read, and the pair."""
        self.scans, self.pair, self.offered = {}, None, None

    def clean_up(self) -> None:
        """Removes the reader's files."""
        shutil.rmtree(self._scratch, ignore_errors=True)

    def begin(self, pair: ScanPair) -> None:
        """Shows two scans as soon as they are read, then makes their case."""
        self.pair, self.offered = pair, None
        both = dict(zip(STATES, (pair.rest, pair.deformed), strict=True))
        scans = _is_ct(pair.rest) and _is_ct(pair.deformed)
        drawn = dict(zip(STATES, pair.labels, strict=True)) if scans else both
        contours = {s: path for s, path in drawn.items() if path is not None and path.is_file() and s not in pair.rois}
        if scans or contours:
            self.read({s: path for s, path in both.items() if scans and s not in self.scans}, pair.series, contours)
        else:
            self._import(pair)

    def choose(self, series: Mapping[str, str], rois: Mapping[str, Rois]) -> None:
        """Goes on with what a person has chosen, by state."""
        if self.pair is not None:
            pair = self.pair
            self.begin(replace(pair, series={**pair.series, **series}, rois={**pair.rois, **rois}))

    def give_up(self) -> None:
        """Nothing was chosen: no case is made."""
        self.forget()
        self._session.say("nothing was chosen, so no case was made; open the scans again to choose")
        self._session.notify("case")

    def read(
        self,
        sources: dict[str, Path],
        series: Mapping[str, str] | None = None,
        contours: Mapping[str, Path] | None = None,
    ) -> None:
        """Starts reading scans, and the labels of the open case. contours : whose structures may have to be named."""
        self._number += 1
        case = self._session.case
        folder = None if case is None else case.folder.path
        job = read_scans.scans_job(sources, folder, self._scratch / f"read{self._number}", series, contours)
        self.reader.start(job, "Reading the scans" if sources else "Reading the labels")
        self._session.notify("job")

    def told(self) -> None:
        """Takes in what the reader has told."""
        state = self.reader.state
        assert state is not None
        while state.found:
            self._found(state.found.pop(0))
        unmade = self.pair if self._session.case is None else None
        if state.outcome == "done" and unmade is not None and self.offered is not None:
            self._session.notify("choice")
        elif state.outcome == "done" and unmade is not None:
            self._import(unmade)
        elif state.outcome == "done":
            self._session.go_on()
        elif state.outcome in ("failed", "cancelled"):
            self.pair = None if unmade is not None else self.pair
            self._session.say(state.error or "reading was cancelled")
        self._session.notify("job")

    def _import(self, pair: ScanPair) -> None:
        request = import_request(pair.rest, pair.deformed, pair.case, pair.labels, pair.series, pair.rois)
        job = step_job.steps_job([request], self._scratch / "import")
        self._session.jobs.start(job, steps.BY_COMMAND["import"].title)
        self._session.notify("job")

    def _found(self, found: Found) -> None:
        """Takes in a scan, or the labels, that have been read."""
        session, case = self._session, self._session.case
        had_labels = session.labels("rest") is not None
        if "offered" in found:
            self.offered = found["offered"]
            return
        if "scan" in found:
            self.scans[found["scan"]["state"]] = mapped_scan(found["scan"])
        elif case is not None:
            told = found["labels"]
            volumes = {state: mapped_labels(one) for state, one in told.items()}
            case.take_labels(volumes, {state: one["hash"] for state, one in told.items()})
            if case.corrections.unsaved:
                session.say("corrections that had not been saved are back; save them or undo them")
        labels = session.labels("rest")
        if (labels is None or not had_labels) and not (case is not None and case.has_session):
            place = first_place(labels, session.ct("rest"))
            session.display.crosshair = place or session.display.crosshair
        session.notify("case")


def _is_ct(path: Path) -> bool:
    """Whether a path is a CT; what cannot be read is told by the import."""
    try:
        return is_ct(path)
    except InputError:
        return False
