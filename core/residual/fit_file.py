"""File of a plain fit, and the key that says of what it is: `identify` writes it, `diagnose` starts from it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from importlib import metadata
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import InputError
from palpate.core.files.damaged_archive import DAMAGED_ARCHIVE
from palpate.core.observe.wall_motion_options import WallMotionOptions
from palpate.core.problem import StateData
from palpate.core.residual.case_data import CaseData, arrays_of_state
from palpate.core.residual.fit_options import INFERENCE, FitOptions
from palpate.core.residual.kept_fit import arrays_of, restored
from palpate.core.residual.noise_model_options import NoiseModelOptions
from palpate.core.residual.plain_fit import PlainFit, fit_plain
from palpate.core.residual.remeshing import Remeshed
from palpate.core.worker.checkpoint import FINGERPRINT, save_checkpoint
from palpate.core.worker.progress import Progress, silent

FILE = "plain_fit.npz"
_DAMAGED: tuple[type[Exception], ...] = (InputError, *DAMAGED_ARCHIVE)
_PACKAGES = ("palpate", "numpy", "scipy", "numba", "pypardiso", "mkl")


@dataclass(frozen=True, kw_only=True)
class FitQuestion:
    """All that decides a plain fit. pairs, remeshed, noise, walls, how : see `fit_plain`. further : name of what errs
    beside the noise model, "" for nothing."""

    pairs: Sequence[StateData]
    remeshed: Sequence[Remeshed] = ()
    noise: NoiseModelOptions = field(default_factory=NoiseModelOptions)
    walls: WallMotionOptions = field(default_factory=WallMotionOptions)
    how: FitOptions = field(default_factory=FitOptions)
    further: str = ""

    def key(self) -> str:
        """SHA-256 of the question, of this program's source and of the packages that compute."""
        stated = {
            "inference": INFERENCE,
            "options": [asdict(self.noise), asdict(self.walls), asdict(self.how), self.further],
            "versions": {name: _version(name) for name in _PACKAGES},
            "source": _source(),
        }
        digest = hashlib.sha256(json.dumps(stated, sort_keys=True).encode())
        for problem, bones in self.pairs:
            _add(digest, arrays_of_state(problem, bones))
        for other in self.remeshed:
            _add(digest, other.arrays("other"))
        return digest.hexdigest()

    def fit(self, progress: Progress = silent) -> PlainFit:
        """A new fit. Precondition: nothing further errs. Raises InputError and ConvergenceError as `fit_plain` does."""
        return fit_plain(self.pairs, self.remeshed, progress, self.noise, self.walls, self.how)


def save_fit(path: Path, fit: PlainFit, key: str) -> None:
    """Write a fit whose question has this key. Raises InputError when the file cannot be written."""
    save_checkpoint(path, arrays_of(fit), key)


def fit_of(
    data: CaseData,
    noise: NoiseModelOptions,
    walls: WallMotionOptions,
    files: Sequence[Path],
    progress: Progress = silent,
) -> tuple[PlainFit, list[str]]:
    """The plain fit of a case, and what is to be said of its files.

    It is read from the first of `files` that holds it; where none does, the model is fitted anew and the last file
    written. Raises InputError and ConvergenceError as `fit_plain` does, InputError when the file cannot be written.
    """
    question = FitQuestion(pairs=data.pairs, remeshed=data.remeshed, noise=noise, walls=walls)
    key, options, notes = question.key(), noise.for_case(data.problem), list[str]()
    for file in files:
        try:
            kept = _read(file, key)
            if kept is not None:
                return restored(kept, question.pairs, options, walls, question.how), notes
        except _DAMAGED as error:
            reason = f"{error} ({type(error).__name__})"
            notes.append(f"{file.parent.name}/{file.name} cannot be read: {reason}; the plain model was fitted again")
    found = question.fit(progress)
    save_fit(files[-1], found, key)
    return restored(arrays_of(found), question.pairs, options, walls, question.how), notes


def _read(path: Path, key: str) -> dict[str, NDArray[np.generic]] | None:
    """Arrays of the file; None where there is no file, or one with another key. Raises what damaged archives raise."""
    if not path.is_file():
        return None
    with np.load(path, allow_pickle=False) as data:
        if str(data[FINGERPRINT]) != key:
            return None
        return {name: data[name] for name in data.files if name != FINGERPRINT}


def _add(digest: hashlib._Hash, arrays: dict[str, NDArray[np.generic]]) -> None:
    for name, values in sorted(arrays.items()):
        digest.update(f"{name} {values.dtype.str} {values.shape};".encode())
        digest.update(np.ascontiguousarray(values).tobytes())


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "absent"


@cache
def _source() -> str:
    """SHA-256 of the mechanics' and the inference's own source: a fit of another state of the program is another fit."""
    digest, core = hashlib.sha256(), Path(__file__).parents[1]
    for path in sorted(core.rglob("*.py")):
        digest.update(f"{path.relative_to(core).as_posix()};".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
