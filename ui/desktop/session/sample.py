"""The sample pair as the window opens it."""

from __future__ import annotations

from pathlib import Path

from palpate.case.sample import sample_scans
from palpate.ui.desktop.session.dropped_files import case_beside


def sample_pair() -> tuple[Path, Path, Path]:
    """Scan at rest, deformed scan, and a case folder to make of them in the person's home. Raises InputError where they are absent."""
    rest, deformed = sample_scans()
    return rest, deformed, case_beside(Path.home() / "palpate" / "sample")
