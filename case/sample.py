"""The simulated sample pair that comes with the program: beside its source, or inside the installed package."""

from __future__ import annotations

from pathlib import Path

import palpate
from palpate.core.errors import InputError

FOLDER = "sample_dicom"


def sample_scans() -> tuple[Path, Path]:
    """Folders of the scan at rest and of the deformed one. Raises InputError where they are absent."""
    package = Path(palpate.__file__).resolve().parent
    for folder in (package / FOLDER, package.parent / FOLDER):
        rest, deformed = folder / "rest", folder / "deformed"
        if rest.is_dir() and deformed.is_dir():
            return rest, deformed
    raise InputError(
        f"the sample pair is not in {package} nor beside it; install Palpate again, or clone its repository"
    )
