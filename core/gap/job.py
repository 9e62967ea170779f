"""Diagnosis as a job of the worker process: case data in one file, diagnosis.json's content and the maps out."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from palpate.core.errors import InputError
from palpate.core.gap.diagnose import CaseData, diagnose
from palpate.core.gap.effects import library
from palpate.core.gap.record import MAP_FILE, maps, record
from palpate.core.problem import IdentificationProblem, Surface, SurfacePair
from palpate.core.worker.checkpoint import save_checkpoint
from palpate.core.worker.executors import one_thread
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter

_KEYS = ("points", "faces", "region")


def run(job: Job, reporter: Reporter) -> dict[str, Any]:
    """Job kind "palpate.core.gap.job:run". paths: data (npz of `arrays`). options: case (its name), effects (folder or null).

    Writes the maps into the job's folder and returns diagnosis.json.
    """
    one_thread()  # the order of sums, and with it the last bits, must not depend on the machine's cores
    data = load(Path(job.paths["data"]))
    folder = job.options.get("effects")
    effects = library(None if folder is None else Path(folder))
    found = diagnose(data, effects, reporter.progress, job.seed)
    save_checkpoint(Path(job.folder) / MAP_FILE, maps(found), job.fingerprint())
    return record(found, str(job.options["case"]))


def arrays(data: CaseData) -> dict[str, NDArray[np.generic]]:
    """For numpy.savez; `load` is the inverse."""
    out = dict(data.problem.arrays())
    if data.bones is not None:
        for state, surface in (("rest", data.bones.rest), ("deformed", data.bones.deformed)):
            out |= {f"bones/{state}/{key}": getattr(surface, key) for key in _KEYS}
    out["gravity"] = np.frombuffer(json.dumps(data.gravity).encode(), dtype=np.uint8)
    return out


def load(path: Path) -> CaseData:
    """Raises InputError when the file is missing or not such data."""
    try:
        with np.load(path, allow_pickle=False) as archive:
            found = {key: archive[key] for key in archive.files}
        gravity = json.loads(bytes(np.asarray(found["gravity"], dtype=np.uint8)).decode())
        problem = IdentificationProblem.from_arrays(found)
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not readable as a case's data ({error}); run diagnose again") from error
    return CaseData(problem, _bones(found), (_vector(gravity[0]), _vector(gravity[1])))


def _vector(value: Any) -> tuple[float, float, float] | None:
    return None if value is None else (float(value[0]), float(value[1]), float(value[2]))


def _bones(found: Mapping[str, NDArray[np.generic]]) -> SurfacePair | None:
    if "bones/rest/points" not in found:
        return None
    rest, deformed = (
        Surface(*(np.asarray(found[f"bones/{state}/{key}"]) for key in _KEYS)) for state in ("rest", "deformed")
    )
    return SurfacePair(rest, deformed)
