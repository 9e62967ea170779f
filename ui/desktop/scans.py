"""A job that reads the scans of a pair, in the worker, into files that the window maps into memory without reading them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from palpate.core.worker.executors import make_executor
from palpate.core.worker.job import Job
from palpate.core.worker.messages import Reporter
from palpate.segmentation.dicom_series import read_series
from palpate.segmentation.grid import in_lps_order
from palpate.segmentation.volume import Volume

KIND = "palpate.ui.desktop.scans:run"


@dataclass(frozen=True, eq=False)
class Scan:
    """volume : HU, axes in LPS order, in the scanner's own frame. source : the folder it was read from. file : the mapped voxels."""

    volume: Volume
    source: str
    file: Path


def run(job: Job, reporter: Reporter) -> dict[str, Any]:
    """Options: sources {state: folder}. The result names each state's file of voxels (NumPy, Fortran order, so that axial slices
    lie together) and its affine. Raises InputError as `read_series`."""
    sources = dict(job.options["sources"])
    reporter.progress(0.05, "reading the scans")
    found = {}
    with make_executor(min(job.workers, len(sources))) as executor:
        read = partial(read_scan, Path(job.folder))
        for number, one in enumerate(executor.map(read, sources, sources.values()), start=1):
            found[one["state"]] = one
            reporter.progress(number / len(sources), f"the {one['state']} scan is read")
    return found


def read_scan(folder: Path, state: str, source: str) -> dict[str, Any]:
    """One scan into STATE.npy of a folder."""
    volume, facts = read_series(source)
    volume = in_lps_order(volume)
    path = folder / f"{state}.npy"
    with path.open("wb") as stream:
        np.save(stream, np.asfortranarray(volume.array))
    return {"state": state, "file": str(path), "affine": volume.affine, "source": source, "notes": list(facts.notes)}


def mapped(found: dict[str, Any]) -> Scan:
    """The scan of one state of the job's result."""
    array = np.load(found["file"], mmap_mode="r")
    return Scan(Volume(array, np.array(found["affine"], dtype=np.float64)), found["source"], Path(found["file"]))
