"""A job that reads scans and labels, in the worker, into files that the window maps into memory without reading them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import TypedDict

import msgspec
import numpy as np

from palpate.case.case_folder import STATES, CaseFolder
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.worker.executors import cores, make_executor
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.imaging.contours.structure_list import is_clear, list_structures
from palpate.imaging.dicom.series_list import list_series
from palpate.imaging.grid import in_lps_order
from palpate.imaging.scans import scan as any_scan
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.labels.journal import content_hash

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


class OfferedSeries(TypedDict):
    """One of several series of a folder; see `imaging.dicom.series_list`. picture : HU of its middle slice, None without."""

    identifier: str
    date: str
    slices: int
    size: tuple[int, int]
    thickness_mm: float | None
    description: str
    picture: list[list[float]] | None


class OfferedStructure(TypedDict):
    """One of the structures of a file; see `imaging.contours.structure_list`."""

    identifier: str
    name: str
    volume_cc: float
    organ: str


class Offered(TypedDict):
    """What a person has to choose from: series of folders, and structures of files, by state."""

    series: dict[str, list[OfferedSeries]]
    structures: dict[str, list[OfferedStructure]]


class Found(TypedDict, total=False):
    """What one progress message brings: a scan, the labels of all states, or what is to be chosen first."""

    scan: ReadScan
    labels: dict[str, ReadLabels]
    offered: Offered


@dataclass(frozen=True, eq=False)
class Scan:
    """volume : HU, axes in LPS order, in the scanner's own frame. file : the mapped voxels."""

    volume: Volume
    file: Path


def scans_job(
    sources: Mapping[str, Path],
    case: Path | None,
    folder: Path,
    series: Mapping[str, str] | None = None,
    contours: Mapping[str, Path] | None = None,
) -> Job:
    """The job that reads scans, and the labels of a case. folder : where their voxels go. series : that were chosen.
    contours : files whose structures may have to be named."""
    options = {
        "sources": {s: str(p) for s, p in sources.items()},
        "case": None if case is None else str(case),
        "series": dict(series or {}),
        "contours": {s: str(p) for s, p in (contours or {}).items()},
    }
    return Job(KIND, str(folder), options=options, workers=cores())


class ReadScans(msgspec.Struct, frozen=True):
    """Options. sources : folder of each state's scan. case : folder whose labels are read. series : chosen ones, by state.
    contours : file of each state whose structures may have to be named."""

    sources: dict[str, str]
    case: str | None = None
    series: dict[str, str] = {}
    contours: dict[str, str] = {}


def run(job: Job, reporter: Reporter) -> dict[str, object]:
    """Options as `ReadScans`. Raises InputError as `any_scan.read_scan`.

    Everything is told when it is read, by a progress message with `found`: labels {state: ...} or scan {...}; the result is empty.
    """
    asked = job.options_as(ReadScans)
    sources, folder = asked.sources, Path(job.folder)
    if asked.case is not None:
        reporter.progress(0.05, "labels", found={"labels": read_labels(folder, CaseFolder(asked.case))})
    offered: Offered = {"series": {}, "structures": unclear_structures(asked.contours)}
    if sources:
        reporter.progress(0.1, "reading the scans")
        with make_executor(min(job.workers, len(sources))) as executor:
            chosen = [asked.series.get(state) for state in sources]
            read = executor.map(partial(read_or_offer, folder), sources, sources.values(), chosen)
            for number, (state, one) in enumerate(zip(sources, read, strict=True), start=1):
                if isinstance(one, list):
                    offered["series"][state] = one
                else:
                    reporter.progress(number / len(sources), f"the {state} scan is read", found={"scan": one})
    if any(offered.values()):
        reporter.progress(1.0, "a choice is needed", found={"offered": offered})
    return {}


def unclear_structures(contours: Mapping[str, str]) -> dict[str, list[OfferedStructure]]:
    """Structures of the files whose names do not tell which is which, by state. Raises InputError for unreadable files."""
    found = {state: list_structures(Path(path)) for state, path in contours.items()}
    return {
        state: [OfferedStructure(**asdict(entry)) for entry in entries]  # type: ignore[typeddict-item]
        for state, entries in found.items()
        if not is_clear(entries, Path(contours[state]))
    }


def read_or_offer(folder: Path, state: str, source: str, series: str | None) -> ReadScan | list[OfferedSeries]:
    """One scan; or the series of its folder where there are several and none is chosen. Raises InputError as `any_scan.read_scan`."""
    try:
        return read_scan(folder, state, source, series)
    except InputError:
        entries = list_series(Path(source)) if series is None and Path(source).is_dir() else []
        if len(entries) < 2:
            raise
    return [
        OfferedSeries(**(vars(entry) | {"picture": None if entry.picture is None else entry.picture.tolist()}))  # type: ignore[typeddict-item]
        for entry in entries
    ]


def read_scan(folder: Path, state: str, source: str, series: str | None = None) -> ReadScan:
    """One scan into STATE.npy of a folder, in Fortran order, so that axial slices lie together."""
    volume, _ = any_scan.read_scan(source, series)
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
