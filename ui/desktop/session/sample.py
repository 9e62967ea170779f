"""The sample pair as the window opens and runs it."""

from __future__ import annotations

from pathlib import Path

from palpate.case.sample import sample_scans
from palpate.ui.desktop.session.dropped_files import case_beside

# The way after the import.
STEPS = ("segment", "mesh", "identify", "diagnose", "report")


def sample_pair() -> tuple[Path, Path, Path]:
    """Scan at rest, deformed scan, and a case folder to make of them in the person's home. Raises InputError where they are absent."""
    rest, deformed = sample_scans()
    return rest, deformed, case_beside(_folder() / "x")


def finished_sample() -> Path | None:
    """The case of the sample that this person's window finished last; None where there is none."""
    reports = _folder().glob("case_*/report/report.html")
    newest = max(reports, key=lambda path: path.stat().st_mtime, default=None)
    return None if newest is None else newest.parent.parent


def _folder() -> Path:
    return Path.home() / "palpate" / "sample"
