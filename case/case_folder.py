"""The case folder: one patient, two states, and what each step has written (docs/case.md)."""

from __future__ import annotations

import hashlib
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import numpy as np

from palpate.case.case_facts import CaseFacts
from palpate.case.case_files import CaseFiles, file_sha256, require_case
from palpate.case.landmarks import Landmarks, read_landmarks
from palpate.case.slimmed import whole_sha256
from palpate.case.step_records import StepRecord
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files import atomic
from palpate.core.files.json_file import as_json, write_json
from palpate.core.files.places import check_outside, check_utf8
from palpate.imaging.contours.itksnap_labels import label_description, label_values
from palpate.imaging.contours.nifti_labels import read_labels, read_nifti, write_labels
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.grid import in_lps_order
from palpate.imaging.scans.scan import read_scan
from palpate.imaging.volume import Volume

STATES = ("rest", "deformed")
# Two steps may end at the same time: each reads what the other has noted.
_STATE = threading.Lock()

__all__ = ["STATES", "CaseFacts", "CaseFolder", "Landmarks", "file_sha256"]


class CaseFolder(CaseFiles):
    """An existing case folder.

    path : the folder. facts : what case.json says.

    Opening removes what killed runs left behind. All writing is atomic and raises InputError naming the file where
    the folder is read-only or the disk full. Raises InputError when ``path`` is no case.
    """

    def __init__(self, path: Path | str) -> None:
        super().__init__(Path(path))
        require_case(self.path)
        atomic.sweep(self.path)
        self.facts = CaseFacts.from_dict(self.read_json("case.json"), str(self.file("case.json")))

    @classmethod
    def create(cls, path: Path | str, facts: CaseFacts) -> CaseFolder:
        """A new case folder, or an existing case with its facts replaced.

        Raises InputError when the folder exists, is no case and is not empty, or cannot be written.
        """
        folder = Path(path)
        check_new_case(folder)
        with atomic.writing(folder):
            folder.mkdir(parents=True, exist_ok=True)
        atomic.sweep(folder)
        write_json(folder / "case.json", facts.to_dict())
        return cls(folder)

    def save_facts(self, facts: CaseFacts) -> None:
        """Replaces case.json."""
        self.write_json("case.json", facts.to_dict())
        self.facts = facts

    # What it holds

    def has_labels(self, state: str) -> bool:
        """Whether the case holds a label volume of ``state`` ("rest" or "deformed")."""
        return self.has(f"{_known(state)}.nii.gz")

    def labels(self, state: str) -> Volume:
        """The label volume (uint8, values of LABELS) of a state, in the rest frame, axes in LPS order.

        Numbers follow labels.txt where the case has one. Raises InputError naming the file.
        """
        values = label_values(self.file("labels.txt")) if self.has("labels.txt") else None
        return in_lps_order(read_labels(self.file(f"{_known(state)}.nii.gz"), values))

    def ct(self, state: str) -> Volume:
        """The CT of a state in HU (int16 or float32), in the rest frame, axes in LPS order; nothing is resampled."""
        volume, _ = self.series(state)
        return in_lps_order(volume.moved(self.deformed_to_rest()) if state == "deformed" else volume)

    def series(self, state: str) -> tuple[Volume, SeriesFacts]:
        """The CT of a state in its scanner's own frame, slices in the files' order, and what else its files say."""
        return read_scan(self.file(f"{_known(state)}_ct"))

    def bones(self, state: str) -> Volume | None:
        """Which bone (values of BONE_PARTS) each bone voxel of a state is, rest frame; None where no bone was told
        apart.
        """
        name = f"{_known(state)}_bones.nii.gz"
        if not self.has(name):
            return None
        found = in_lps_order(read_nifti(self.file(name)))
        return found.with_array(found.array.astype(np.uint8)) if found.array.any() else None

    def write_labels(self, state: str, labels: Volume) -> Path:
        """Writes the label volume of a state, which must be in the rest frame, and labels.txt beside it."""
        name = f"{_known(state)}.nii.gz"
        with self.atomic_path(name) as temporary:
            write_labels(temporary, labels)
        self.write_text("labels.txt", label_description())
        return self.file(name)

    def deformed_to_rest(self) -> FloatArray:
        """The rigid transform (4, 4), LPS mm, that brings the deformed scan into the rest frame; identity without
        one.
        """
        if not self.has("alignment.json"):
            return np.eye(4)
        return np.array(self.read_json("alignment.json")["deformed_to_rest"], dtype=np.float64)

    def landmarks(self) -> Landmarks | None:
        """The matched points of landmarks.csv; None where the case has none."""
        return read_landmarks(self.file("landmarks.csv")) if self.has("landmarks.csv") else None

    # Steps

    def inputs_sha256(
        self, names: Iterable[str], options: object = None, hash_of: Callable[[Path], str] | None = None
    ) -> str:
        """One hash of the named files and folders (absent ones count as absent, slimmed ones as whole) and of JSON-able options.

        hash_of : the hash of one file, for who keeps them.
        """
        hash_of = hash_of or file_sha256
        digest = hashlib.sha256()
        for name in sorted(names):
            path = self.file(name)
            members = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
            for member in members:
                name = member.relative_to(self.path).as_posix()
                content = whole_sha256(self, name, hash_of(member)) if member.is_file() else "absent"
                digest.update(f"{name}\0{content}\0".encode())
        digest.update(as_json(options).encode())
        return digest.hexdigest()

    def step_is_done(self, step: str, inputs_sha256: str) -> bool:
        """Whether the step ran to its end on these inputs and its outputs are still there.

        Outputs are not compared: a person may have corrected them, and a rerun must not undo that.
        """
        entry = self._state().get(step, {})
        same = entry.get("done") is True and entry.get("inputs_sha256") == inputs_sha256
        return same and all(self.has(name) for name in entry.get("outputs", []))

    def step_record(self, step: str) -> StepRecord:
        """What state.json notes of a step that ran to its end; empty where it never did."""
        entry = self._state().get(step)
        return entry if isinstance(entry, dict) and entry.get("done") is True else {}

    def mark_done(
        self, step: str, inputs_sha256: str, outputs: Iterable[str], more: Mapping[str, object] | None = None
    ) -> None:
        """Notes in state.json that the step ran to its end; call it after its last file is written. more : further keys
        to note.
        """
        entry = {"inputs_sha256": inputs_sha256, "outputs": list(outputs), "done": True, **(more or {})}
        with _STATE:
            self.write_json("state.json", {**self._state(), step: entry})

    def _state(self) -> Mapping[str, StepRecord]:
        state = self.read_json("state.json") if self.has("state.json") else {}
        if not isinstance(state, dict):
            raise InputError(f"{self.file('state.json')} holds no JSON object; remove it and run the steps again")
        return state

    def check_writable(self) -> None:
        """Raises InputError where the folder is read-only."""
        if atomic.is_read_only(self.path):
            raise InputError(
                f"{self.path} cannot be written (the place is read-only); copy the case to a writable place"
            )


def check_beside_scans(case: CaseFolder, place: Path) -> None:
    """Raises InputError where a file or folder that is to be written would join the slices of a case's own scans."""
    check_outside(place, [case.file(f"{state}_ct") for state in STATES])


def check_new_case(folder: Path, scans: Iterable[Path] = ()) -> None:
    """Raises InputError unless ``folder`` can become, or is, a case: no file, not full of other things, writable, not within the
    folder of a scan, and with a name in UTF-8, which the case's files hold.
    """
    check_utf8(folder, "choose another folder for the case with -o")
    check_outside(folder, scans)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; choose a new folder for the case with -o")
    if folder.is_dir() and not (folder / "case.json").exists():
        others = [entry for entry in folder.iterdir() if not atomic.is_leftover(entry)]
        if others:
            raise InputError(f"{folder} is not empty and no case; choose a new folder for the case with -o")
    if atomic.is_read_only(folder):
        raise InputError(f"{folder} cannot be written (the place is read-only); choose a writable place with -o")


def _known(state: str) -> str:
    if state not in STATES:
        raise InputError(f"the state {state!r} is unknown; a case has {' and '.join(STATES)}")
    return state
