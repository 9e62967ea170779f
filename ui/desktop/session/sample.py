"""The sample pair that comes with the program's repository."""

from __future__ import annotations

from pathlib import Path

import palpate
from palpate.core.errors import InputError
from palpate.ui.desktop.session.dropped_files import case_beside


def sample_pair() -> tuple[Path, Path, Path]:
    """Scan at rest, deformed scan, and a case folder to make of them in the person's home. Raises InputError where they are absent."""
    folder = Path(palpate.__file__).resolve().parents[1] / "sample_dicom"
    rest, deformed = folder / "rest", folder / "deformed"
    if not (rest.is_dir() and deformed.is_dir()):
        raise InputError(f"{folder} is not there; the sample comes with the repository, not with the installed program")
    return rest, deformed, case_beside(Path.home() / "palpate" / "sample")
