"""A DICOM series as one volume in patient coordinates, or a refusal that says why."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pydicom

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.imaging.dicom.files import DicomFile, find_dicom
from palpate.imaging.dicom.hounsfield import check_hounsfield, soft_tissue_note
from palpate.imaging.dicom.pixels import read_slices
from palpate.imaging.dicom.regrid import as_volume
from palpate.imaging.dicom.series_choice import choose_series
from palpate.imaging.dicom.slices import Slice, is_localizer, slices_of
from palpate.imaging.dicom.stack import SAME_PLACE_MM, Stack, in_order, stack
from palpate.imaging.volume import Volume

# Modality of DICOM registrations.
REGISTRATION = "REG"


@dataclass(frozen=True)
class SeriesFacts:
    """What else a series says. Nothing here is the patient's name, number or birth date.

    patient_hash : SHA-256 of the patient's number and name, None where both are blank; for comparing in memory only.
    study_date : YYYYMMDD. sop_uids, frames, paths : of each slice in slice order (frame is the index in its file).
    registrations : DICOM registrations (REG) that lie within the folder.
    regridded : the volume's slices are not those of the files (tilted gantry, uneven gaps).
    notes : what was done that a person should know, one line each.
    """

    series_uid: str
    frame_of_reference_uid: str
    patient_hash: str | None
    study_date: str | None
    patient_position: str | None
    modality: str
    sop_class_uid: str
    sop_uids: tuple[str, ...]
    frames: tuple[int, ...]
    paths: tuple[Path, ...]
    regridded: bool
    notes: tuple[str, ...]
    registrations: tuple[Path, ...] = ()

    @property
    def is_dicom(self) -> bool:
        """Whether the scan is DICOM, so that objects can refer to its images."""
        return bool(self.sop_class_uid)

    @property
    def place(self) -> Path:
        """What a person gave: the folder of the slices, or the file."""
        return self.paths[0].parent if self.is_dicom else self.paths[0]

    @property
    def files(self) -> tuple[Path, ...]:
        """The files of the series, each once, in slice order."""
        return tuple(dict.fromkeys(self.paths))

    def telling_images(self) -> set[str]:
        """The SOP instances, as far as they tell images apart: not where an anonymiser removed them or made them alike."""
        files = len(set(self.paths))
        told = set(self.sop_uids) - {""}
        return told if len(told) == files else set()

    def telling_frame_of_reference(self) -> str | None:
        """The frame of reference; None where it is blank, or an anonymiser wrote one UID for everything."""
        uid = self.frame_of_reference_uid
        return uid if uid and uid not in (self.series_uid, *self.sop_uids) else None


def read_series(
    folder: Path | str, series: str | None = None, modalities: Sequence[str] = ("CT",)
) -> tuple[Volume, SeriesFacts]:
    """The volume (HU, int16 or float32) and the facts of the one CT series under a folder.

    The volume's k axis runs along the slices' normal, i along their rows, j along their columns.
    series : number in the list of choices, or beginning or end of the SeriesInstanceUID, where there are several.
    modalities : which kinds of image are wanted.

    Raises InputError, one line that names the file or folder and the remedy, for anything that is not one regular volume.
    """
    folder = Path(folder)
    notes: list[str] = []
    found = find_dicom(folder, notes)
    files = choose_series(found, folder, series, modalities)
    ordered = _stack(files, folder, notes)
    volume = as_volume(read_slices(ordered.slices, notes), ordered, notes)
    if files[0].header.get("Modality") == "CT":
        check_hounsfield(volume, folder, each_slice=len({each.intercept for each in ordered.slices}) > 1)
        notes += soft_tissue_note(volume)
    registrations = tuple(file.path for file in found if file.header.get("Modality") == REGISTRATION)
    return volume, replace(_facts(files[0].header, ordered, notes), registrations=registrations)


def _stack(files: Sequence[DicomFile], folder: Path, notes: list[str]) -> Stack:
    scouts = [file for file in files if is_localizer(file.header)]
    if scouts:
        notes.append(f"{len(scouts)} scout images were left out, the first is {scouts[0].path.name}")
    slices = [each for file in files if file not in scouts for each in slices_of(file)]
    frames_of_reference = {str(file.header.get("FrameOfReferenceUID", "")) for file in files if file not in scouts}
    if len(frames_of_reference) > 1:
        raise InputError(f"{folder}: the series has {len(frames_of_reference)} frames of reference; give one scan")
    ordered, positions = in_order(slices, folder)
    ordered, positions = _without_copies(ordered, positions, notes)
    return stack(ordered, positions, folder)


def _without_copies(slices: list[Slice], positions: FloatArray, notes: list[str]) -> tuple[list[Slice], FloatArray]:
    """Each position once. Raises InputError where two slices at one position differ."""
    kept = [0]
    for index in range(1, len(slices)):
        before = slices[kept[-1]]
        if positions[index] - positions[kept[-1]] > SAME_PLACE_MM:
            kept.append(index)
        elif np.ptp(read_slices([before, slices[index]]).astype(np.float32), axis=0).any():
            raise InputError(
                f"{slices[index].path} and {before.path.name} are two different images at position {positions[index]:.1f} mm; "
                "keep the slices of one reconstruction"
            )
    if len(kept) < len(slices):
        notes.append(f"{len(slices) - len(kept)} slices were there twice and are used once")
    return [slices[i] for i in kept], positions[kept]


def _facts(header: pydicom.Dataset, ordered: Stack, notes: list[str]) -> SeriesFacts:
    date = str(header.get("StudyDate") or header.get("SeriesDate") or "").strip()
    return SeriesFacts(
        series_uid=str(header.get("SeriesInstanceUID", "")),
        frame_of_reference_uid=str(header.get("FrameOfReferenceUID") or "").strip(),
        patient_hash=patient_hash(header),
        study_date=date if len(date) == 8 and date.isdigit() else None,
        patient_position=str(header.get("PatientPosition") or "").strip() or None,
        modality=str(header.get("Modality", "")),
        sop_class_uid=str(header.get("SOPClassUID", "")),
        sop_uids=tuple(s.sop_uid for s in ordered.slices),
        frames=tuple(s.frame for s in ordered.slices),
        paths=tuple(s.path for s in ordered.slices),
        regridded=not ordered.even or bool(ordered.shift.any()),
        notes=tuple(notes),
    )


def patient_hash(header: pydicom.Dataset) -> str | None:
    """SHA-256 of the patient's number and name; case, blanks and carets do not count. None where both are blank."""
    texts = [str(header.get(keyword) or "") for keyword in ("PatientID", "PatientName")]
    plain = ["".join(c for c in text.casefold() if not c.isspace() and c != "^") for text in texts]
    return hashlib.sha256("\0".join(plain).encode()).hexdigest() if any(plain) else None
