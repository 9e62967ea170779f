"""A case as the window holds it: labels that can be corrected, what was found, and what a person pointed at."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ParamSpec, TypedDict

import numpy as np

from palpate.case.case_folder import STATES, CaseFolder
from palpate.case.diagnosed import DIAGNOSIS, read_diagnosis
from palpate.case.identified import map_arrays, read_result
from palpate.case.measured.measurements import read_measurements
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.display import Display
from palpate.ui.desktop.session.labels.journal import Journal, content_hash, replay
from palpate.ui.desktop.session.labels.strokes import Corrections
from palpate.ui.pictures.gap_pictures import size_in_sd
from palpate.ui.report.record import read_record, simulated
from palpate.ui.report.regions import RegionStiffness, regions_of
from palpate.ui.report.summary import first_sentences

Arguments = ParamSpec("Arguments")
SESSION, EDITS, LOCK = "desktop/session.json", "desktop/edits.jsonl", "desktop/lock"


class SessionData(TypedDict, total=False):
    """desktop/session.json: how the case was shown, and seeds by state and name, mm."""

    display: dict[str, object]
    seeds: dict[str, dict[str, list[float]]]


@dataclass(frozen=True, eq=False)
class GapMap:
    """points (n, 3) mm at rest, residual (n,) mm: predicted surface outside (+) or inside (-) the scan's. diagnosed : from
    `diagnose`, smoothed; else the plain misfit of `identify`. places (w, 3) mm, missed (w, 3) mm, missed_sd (w,) : predicted minus
    matched motion in and around the organ, and its size in standard deviations; none without images."""

    points: FloatArray
    residual: FloatArray
    diagnosed: bool
    places: FloatArray
    missed: FloatArray
    missed_sd: FloatArray


class OpenCase:
    """folder : the case. deformed_to_rest : (4, 4).

    measurements : that a person made. volumes : state -> labels, in place. corrections : on them. seeds : state -> name -> (x, y, z) mm,
    both states in the rest frame.

    Raises InputError when the folder is no case, a file in it is damaged, or another window has it open.
    """

    def __init__(self, path: Path) -> None:
        self.folder = CaseFolder(path)
        self._lock: int | None = _locked(self.folder.file(LOCK))
        self._writer = ThreadPoolExecutor(1, "palpate-writer")
        session = self._session()
        self.display = Display.from_dict(dict(session.get("display", {})))
        self.has_session = "display" in session
        self.seeds: dict[str, dict[str, list[float]]] = {
            state: dict(session.get("seeds", {}).get(state, {})) for state in STATES
        }
        self.failures: list[str] = []
        self.deformed_to_rest = self.folder.deformed_to_rest()
        self.corrections = Corrections({})
        self.journal: Journal | None = None
        self.measurements = read_measurements(self.folder)
        self.read_results()

    def take_labels(self, volumes: dict[str, Volume], hashes: Mapping[str, str]) -> None:
        """Labels as they are on disk, with the hashes of their voxels; makes the strokes again that were not saved."""
        self.flush()
        self.corrections = Corrections(volumes)
        again = replay(self.folder.file(EDITS), self.corrections, hashes)
        if self.journal is not None:
            self.journal.close()
        self.journal = Journal(self.folder.file(EDITS), self._writer)
        if not again and volumes:
            self.journal.start_over(hashes)

    def read_results(self) -> None:
        """What identify and diagnose have found, as far as they have been run."""
        result = read_result(self.folder) if self.folder.has("result.json") else None
        self.result = result
        self.diagnosis = read_diagnosis(self.folder) if self.folder.has(DIAGNOSIS) else None
        self.regions: tuple[RegionStiffness, ...] = () if result is None else regions_of(result, self.folder.facts)
        self.notes_on_labels = self._notes_on_labels()
        self.first_words = first_sentences(read_record(self.folder, {})) if self.regions else []
        self.simulated = ""
        with contextlib.suppress(InputError):  # reading the scans tells what is wrong with them
            self.simulated = simulated(self.folder, result) or ""
        self.gap = self._gap()
        self.stiffness_map = None if result is None else map_arrays(self.folder, result)

    @property
    def volumes(self) -> dict[str, Volume]:
        """Label volumes by state."""
        return self.corrections.volumes

    def save_labels(self) -> None:
        """Writes the labels as they are; what is drawn meanwhile counts as unsaved."""
        if self.journal is not None:
            copies = {state: volume.with_array(volume.array.copy()) for state, volume in self.volumes.items()}
            self.corrections.saved()
            self.later(self._write_labels, copies, self.journal, self.journal.acts)

    def discard(self) -> None:
        """Gives up corrections that are not saved; the case has no labels till they are read again. The strokes are kept beside."""
        self.flush()
        if self.journal is not None:
            hashes = {state: content_hash(self.folder.labels(state)) for state in self.volumes}
            self.journal.start_over(hashes)
            self.journal.close()
        self.journal, self.corrections = None, Corrections({})

    def keep_corrected(self) -> None:
        """Copies labels that were corrected by hand, before a step writes new ones."""
        if not (self.corrections.can_undo or self.corrections.unsaved):
            return
        for state in self.volumes:
            source = self.folder.file(f"{state}.nii.gz")
            if source.exists():
                self.folder.write_bytes(f"desktop/{state}_corrected.nii.gz", source.read_bytes())

    def save_session(self) -> None:
        """Notes how the case is shown and the seeds."""
        data = {"display": self.display.to_dict(), "seeds": {state: dict(s) for state, s in self.seeds.items()}}
        self.later(self.folder.write_json, SESSION, data)

    def later(self, act: Callable[Arguments, object], *arguments: Arguments.args, **more: Arguments.kwargs) -> None:
        """Does something in the writing thread, one after the other; `failures` tells what went wrong there."""
        self._writer.submit(self._tried, partial(act, *arguments, **more))

    def flush(self) -> None:
        """Waits till all is written."""
        self._writer.submit(lambda: None).result()

    def close(self) -> None:
        """Leaves the case to others."""
        self._writer.shutdown(wait=True)
        if self.journal is not None:
            self.journal.close()
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def _tried(self, act: Callable[[], object]) -> None:
        try:
            act()
        except (InputError, OSError) as error:
            self.failures.append(" ".join(str(error).split()))

    def _write_labels(self, volumes: Mapping[str, Volume], journal: Journal, acts: int) -> None:
        journal.mark({state: content_hash(volume) for state, volume in volumes.items()}, acts)
        for state, volume in volumes.items():
            if not np.array_equal(self.folder.labels(state).array, volume.array):  # an unchanged file keeps its date
                self.folder.write_labels(state, volume)

    def _gap(self) -> GapMap | None:
        mapped = "" if self.diagnosis is None else self.diagnosis.where.map
        for name, diagnosed in ((mapped, True), ("identify/fields.npz", False)):
            if not name.endswith(".npz") or not self.folder.has(name):
                continue
            arrays = self.folder.read_npz(name)
            points = arrays.get("points", arrays.get("surface_points"))
            residual = arrays.get("residual_mm", arrays.get("surface_residual"))
            if points is not None and residual is not None and len(points) == len(residual) > 0:
                none = np.zeros((0, 3))
                places, missed = arrays.get("motion/places", none), arrays.get("motion/residual_mm", none)
                sd = size_in_sd(arrays.get("motion/standardised", none))
                return GapMap(points, residual.astype(np.float64), diagnosed, places, missed, sd)
        return None

    def _session(self) -> SessionData:
        with contextlib.suppress(InputError):  # how it looked is not worth a refusal
            found: SessionData = self.folder.read_json(SESSION) if self.folder.has(SESSION) else {}
            return found if isinstance(found, dict) else {}
        return {}

    def _notes_on_labels(self) -> list[str]:
        """What `segment` noted."""
        found = self.folder.read_json("segmentation.json") if self.folder.has("segmentation.json") else {}
        return [str(note) for note in found.get("notes", ())] if isinstance(found, dict) else []


def _locked(path: Path) -> int:
    """Holds the case for this window; the system lets go when the process ends, however it ends."""
    path.parent.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        _lock(descriptor)
    except OSError as error:
        os.close(descriptor)
        raise InputError(f"{path.parent.parent} is open in another window; close that one first") from error
    return descriptor


def _lock(descriptor: int) -> None:
    """Raises OSError where another process, or another opening in this one, holds it."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
