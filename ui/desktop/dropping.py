"""What folders that a person drops or chooses stand for."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

_REST_WORDS, _DEFORMED_WORDS = ("rest", "empty", "before"), ("deform", "full", "balloon", "after", "inflat")


@dataclass
class Pair:
    """The two scans and the case to make of them, as far as they are chosen."""

    rest: Path | None = None
    deformed: Path | None = None
    case: Path | None = None

    def take(self, paths: list[Path]) -> Path | None:
        """Takes dropped folders. Returns a case among them, which is to be opened; scans fill the free places."""
        for path in paths:
            if (path / "case.json").is_file():
                return path
        scans = sorted((path for path in paths if path.exists()), key=_looks_deformed)
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

    def why_not(self) -> str:
        """Why the pair cannot be opened yet; empty when it can."""
        if self.rest is None or self.deformed is None:
            return "choose both scans first"
        if self.case is None:
            return "choose where the case shall be made"
        for path in (self.rest, self.deformed):
            if not path.exists():
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
