"""The sample pair that ships in the repository, checked by hash.

After it was made anew: ``python -m PalpateStiffnessLib.sample`` in the folder above prints the hashes.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from .errors import InputError

STATES = ("rest", "deformed")
FOLDER = Path(__file__).resolve().parents[3] / "sample_dicom"
SHA256 = {
    "rest": "287e013e64c4f83d2c1287addc4eceeab55ff29b3f9d07939fffa562e4bd00ea",
    "deformed": "dc8e1ece60379e980f1b2621c3fc90e56d2cd9eca0326efdce7d9ac428cf57a2",
}


def sample_pair(folder: Path = FOLDER) -> tuple[Path, Path]:
    """The folders of the scan at rest and the deformed one. Raises InputError where they are absent or changed."""
    for state in STATES:
        if not (folder / state).is_dir():
            raise InputError(
                f"The sample pair is not in {folder}; clone the repository of Palpate and load the module from there."
            )
        if sha256_of(folder / state) != SHA256[state]:
            raise InputError(
                f"The sample scan in {folder / state} is not the one this module knows; check it out again."
            )
    return folder / "rest", folder / "deformed"


def sha256_of(folder: Path) -> str:
    """One hash of the DICOM files of a folder, names and contents."""
    digest = hashlib.sha256()
    for path in sorted(folder.glob("*.dcm")):
        digest.update(f"{path.name}\0{hashlib.sha256(path.read_bytes()).hexdigest()}\0".encode())
    return digest.hexdigest()


if __name__ == "__main__":
    for each in STATES:
        print(f'    "{each}": "{sha256_of(FOLDER / each)}",')
