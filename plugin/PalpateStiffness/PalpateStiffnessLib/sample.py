"""The simulated sample pair, which ships in the repository that this module lies in: nothing is downloaded."""

from __future__ import annotations

from pathlib import Path

from .errors import InputError

FOLDER = Path(__file__).resolve().parents[3] / "sample_dicom"


def sample_pair(folder: Path = FOLDER) -> tuple[Path, Path]:
    """The folders of the scan at rest and the deformed one. Raises InputError where they are absent."""
    rest, deformed = folder / "rest", folder / "deformed"
    if not all(any(each.glob("*.dcm")) for each in (rest, deformed)):
        raise InputError(
            f"The sample pair is not in {folder}; clone the repository of Palpate and load the module from there."
        )
    return rest, deformed
