"""What folders that a person drops or chooses stand for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

_REST_WORDS, _DEFORMED_WORDS = ("rest", "empty", "before"), ("deform", "full", "balloon", "after", "inflat")


@dataclass
class Pair:
    """The two scans, contours of them, and the case to make, as far as they are chosen."""

    rest: Path | None = None
    deformed: Path | None = None
    case: Path | None = None
    rest_labels: Path | None = None
    deformed_labels: Path | None = None

    def take(self, paths: list[Path]) -> Path | None:
        """Takes dropped folders. Returns a case among them, which is to be opened; scans fill the free places."""
        for path in paths:
            if (path / "case.json").is_file():
                return path
        there = sorted((path for path in paths if path.exists()), key=_looks_deformed)
        folders = [path for path in there if path.is_dir()] or [
            p for p in (self.rest, self.deformed) if p and p.is_dir()
        ]
        # A file beside scans that are folders holds contours; two files alone are label volumes to make a case of.
        scans = [path for path in there if path.is_dir() or not folders]
        self._take_labels([path for path in there if path not in scans])
        if len(scans) >= 2:
            self.rest, self.deformed = scans[0], scans[1]
        elif scans:
            if self.rest is None and not _looks_deformed(scans[0]):
                self.rest = scans[0]
            elif self.deformed is None:
                self.deformed = scans[0]
            else:
                self.rest = scans[0]
        if scans and self.case is None:
            self.case = case_beside(scans[0])
        return None

    def _take_labels(self, files: list[Path]) -> None:
        for path in files:
            if self.rest_labels is None and not (_looks_deformed(path) and self.deformed_labels is None):
                self.rest_labels = path
            else:
                self.deformed_labels = path

    def why_not(self) -> str:
        """Why the pair cannot be opened yet; empty when it can."""
        if self.rest is None or self.deformed is None:
            return "choose both scans first"
        if self.case is None:
            return "choose where the case shall be made"
        for path in (self.rest, self.deformed, self.rest_labels, self.deformed_labels):
            if path is not None and not path.exists():
                return f"{path} is not there"
        if self.rest == self.deformed:
            return "both are the same folder"
        if self.case.is_dir() and any(self.case.iterdir()) and not (self.case / "case.json").exists():
            return f"{self.case} is not empty; choose a new folder for the case"
        return ""


def case_beside(scan: Path) -> Path:
    """A new folder beside a scan's. Its name says nothing of the scan's, which may be a patient's."""
    number = 1
    while (path := scan.absolute().parent / f"case_{number:02d}").exists():
        number += 1
    return path


def _looks_deformed(path: Path) -> bool:
    name = path.name.casefold()
    return any(w in name for w in _DEFORMED_WORDS) and not any(w in name for w in _REST_WORDS)
