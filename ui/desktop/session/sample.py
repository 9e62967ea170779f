"""The sample pair as the window opens and runs it."""

from __future__ import annotations

from pathlib import Path

from palpate.case.case_files import file_sha256
from palpate.case.sample.finished import finished_archive, unpack
from palpate.case.sample.scans import sample_scans
from palpate.ui.desktop.session.dropped_files import case_beside

# The way after the import.
STEPS = ("segment", "mesh", "identify", "diagnose", "report")


def sample_pair() -> tuple[Path, Path, Path]:
    """Scan at rest, deformed scan, and a case folder to make of them in the person's home. Raises InputError where they are absent."""
    rest, deformed = sample_scans()
    return rest, deformed, case_beside(_folder() / "x")


def finished_sample() -> Path:
    """The finished case that comes with the program, in the person's home; what has been done to it there before is kept.

    Another version's sample is another folder. Raises InputError where the folder cannot be written or the sample is absent.
    """
    folder = _folder() / f"finished_{file_sha256(finished_archive())[:8]}"
    unpack(folder)
    return folder


def _folder() -> Path:
    return Path.home() / "palpate" / "sample"
