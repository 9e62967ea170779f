"""The simulated sample pair that comes with the program: beside its source, or inside the installed package."""

from __future__ import annotations

from pathlib import Path

import palpate
from palpate.core.errors import InputError

FOLDER = "sample_dicom"


def sample_folder() -> Path:
    """The folder of the sample. Raises InputError where it is absent."""
    package = Path(palpate.__file__).resolve().parent
    for folder in (package / FOLDER, package.parent / FOLDER):
        if all((folder / state).is_dir() for state in ("rest", "deformed")):
            return folder
    raise InputError(
        f"the sample pair is not in {package} nor beside it; install Palpate again, or clone its repository"
    )


def sample_scans() -> tuple[Path, Path]:
    """Folders of the scan at rest and of the deformed one. Raises InputError where they are absent."""
    folder = sample_folder()
    return folder / "rest", folder / "deformed"
