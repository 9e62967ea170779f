"""Checkpoints: arrays and the fingerprint of their job in one file, which is written whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.files.atomic import atomic_path
from palpate.core.files.damaged_archive import DAMAGED_ARCHIVE

Arrays = dict[str, NDArray[np.generic]]

# Name of the array that holds the fingerprint.
FINGERPRINT = "job_fingerprint"


def save_checkpoint(path: Path, arrays: Mapping[str, NDArray[np.generic]], fingerprint: str) -> None:
    """Write arrays without pickle, atomically: a kill leaves the previous checkpoint or this one.

    Raises InputError when the file cannot be written, TypeError for an array that only pickle could hold.
    """
    if any(np.asarray(a).dtype.hasobject for a in arrays.values()):
        raise TypeError(f"a checkpoint holds numbers and text, no objects: {sorted(arrays)}")
    content: dict[str, Any] = {FINGERPRINT: np.array(fingerprint), **arrays}
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez(stream, **content)


def load_checkpoint(path: Path, fingerprint: str) -> Arrays | None:
    """The arrays; None when there is no readable checkpoint of this job."""
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays: Arrays = {k: data[k] for k in data.files}
    except DAMAGED_ARCHIVE:
        return None
    return arrays if str(arrays.pop(FINGERPRINT, "")) == fingerprint else None
