"""A job that reads scans and labels, in the worker, into files that the window maps into memory without reading them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypedDict

import msgspec
import numpy as np

from palpate.case.case_folder import STATES, CaseFolder
from palpate.core.arrays import FloatArray
from palpate.core.worker.executors import cores, make_executor
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.imaging.dicom.series import read_series
from palpate.imaging.grid import in_lps_order
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.journal import content_hash

KIND = "palpate.ui.desktop.session.read_scans:run"


class MappedFile(TypedDict):
    """Voxels in a file of NumPy, and their affine (4, 4)."""

    file: str
    affine: FloatArray


class ReadScan(MappedFile):
    """A scan, HU."""

    state: str


class ReadLabels(MappedFile):
    """Labels, and the hash of their voxels."""

    hash: str


class Found(TypedDict, total=False):
    """What one progress message brings: a scan, or the labels of all states."""

    scan: ReadScan
    labels: dict[str, ReadLabels]


@dataclass(frozen=True, eq=False)
class Scan:
    """volume : HU, axes in LPS order, in the scanner's own frame. file : the mapped voxels."""

    volume: Volume
    file: Path


def scans_job(sources: Mapping[str, Path], case: Path | None, folder: Path) -> Job:
    """The job that reads scans, and the labels of a case; folder : where their voxels go."""
    options = {"sources": {s: str(p) for s, p in sources.items()}, "case": None if case is None else str(case)}
    return Job(KIND, str(folder), options=options, workers=cores())


class ReadScans(msgspec.Struct, frozen=True):
    """Options. sources : folder of each state's scan. case : folder whose labels are read."""

    sources: dict[str, str]
    case: str | None = None


def run(job: Job, reporter: Reporter) -> dict[str, object]:
    """Options as `ReadScans`. Raises InputError as `read_series`.

    Everything is told when it is read, by a progress message with `found`: labels {state: ...} or scan {...}; the result is empty.
    """
    asked = job.options_as(ReadScans)
    sources, folder = asked.sources, Path(job.folder)
    if asked.case is not None:
        reporter.progress(0.05, "labels", found={"labels": read_labels(folder, CaseFolder(asked.case))})
    if sources:
        reporter.progress(0.1, "reading the scans")
        with make_executor(min(job.workers, len(sources))) as executor:
            read = executor.map(partial(read_scan, folder), sources, sources.values())
            for number, one in enumerate(read, start=1):
                reporter.progress(number / len(sources), f"the {one['state']} scan is read", found={"scan": one})
    return {}


def read_scan(folder: Path, state: str, source: str) -> ReadScan:
    """One scan into STATE.npy of a folder, in Fortran order, so that axial slices lie together."""
    volume, _ = read_series(source)
    volume = in_lps_order(volume)
    path = folder / f"{state}.npy"
    with path.open("wb") as stream:
        np.save(stream, np.asfortranarray(volume.array))
    return {"state": state, "file": str(path), "affine": volume.affine}


def read_labels(folder: Path, case: CaseFolder) -> dict[str, ReadLabels]:
    """The label volumes of a case into files of a folder: state -> file, affine and hash of the voxels."""
    found: dict[str, ReadLabels] = {}
    for state in STATES:
        if case.has_labels(state):
            labels = case.labels(state)
            path = folder / f"labels_{state}.npy"
            np.save(path, np.ascontiguousarray(labels.array, dtype=np.uint8))
            found[state] = {"file": str(path), "affine": labels.affine, "hash": content_hash(labels)}
    return found


def mapped_scan(found: MappedFile) -> Scan:
    """A scan that the job has told of."""
    path = Path(found["file"])
    return Scan(Volume(np.load(path, mmap_mode="r"), np.array(found["affine"], dtype=np.float64)), path)


def mapped_labels(found: MappedFile) -> Volume:
    """Labels that the job has told of; what is changed in them stays in this process."""
    return Volume(np.load(found["file"], mmap_mode="c"), np.array(found["affine"], dtype=np.float64))
