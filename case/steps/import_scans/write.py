"""Files of a case folder that an import writes."""

from __future__ import annotations

import shutil
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from palpate.case.case_facts import CaseFacts, Vector
from palpate.case.case_folder import CaseFolder
from palpate.case.landmarks import Landmarks, landmarks_csv
from palpate.core.arrays import FloatArray
from palpate.imaging.contours.label_reader import UserLabels
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.dicom.series import SeriesFacts
from palpate.imaging.registration.align_on_bone import Alignment
from palpate.imaging.scans.scan import KEPT
from palpate.imaging.scans.volume_file import write_volume_file
from palpate.imaging.volume import Volume

# Gravity, m/s2, LPS, by the last letters of DICOM's PatientPosition (after head or feet first).
_DOWN: dict[str, Vector] = {
    "S": (0.0, 9.81, 0.0),
    "P": (0.0, -9.81, 0.0),
    "DL": (9.81, 0.0, 0.0),
    "DR": (-9.81, 0.0, 0.0),
}


def gravity_of(patient_position: str | None) -> Vector | None:
    """Gravity, m/s2, LPS, from DICOM's PatientPosition (HFS, FFP, HFDR, ...); None when unknown."""
    return _DOWN.get((patient_position or "")[2:].upper())


def open_or_create(folder: Path, name: str | None, gravity: Sequence[Vector | None]) -> CaseFolder:
    """The case at `folder`. An existing case keeps its facts, which a person may have corrected."""
    if (folder / "case.json").exists():
        case = CaseFolder(folder)
        if case.facts.gravity_deformed is None and gravity[1] is not None:  # the scan at rest was imported alone before
            case = CaseFolder.create(folder, replace(case.facts, gravity_deformed=gravity[1]))
        return case
    facts = CaseFacts(name or folder.absolute().name, gravity_rest=gravity[0], gravity_deformed=gravity[1])
    return CaseFolder.create(folder, facts)


def write_scan(case: CaseFolder, state: str, volume: Volume, facts: SeriesFacts) -> list[str]:
    """Copies a series' files as they are, under plain names in slice order; a CT that was no DICOM becomes one NRRD file."""
    with case.atomic_folder(f"{state}_ct") as temporary:
        if not facts.is_dicom:
            write_volume_file(temporary / KEPT, volume)
            return [f"{state}_ct"]
        for number, file in enumerate(facts.files, start=1):
            shutil.copyfile(file, temporary / f"{number:04d}.dcm")
    return [f"{state}_ct"]


def write_alignment(case: CaseFolder, alignment: Alignment | None) -> FloatArray:
    """Writes alignment.json and returns its transform (4, 4), deformed to rest; the identity where none was made."""
    if alignment is None:
        case.write_json("alignment.json", {"deformed_to_rest": np.eye(4), "residual_mm": None})
        return np.eye(4)
    case.write_json("alignment.json", alignment.to_dict())
    return alignment.deformed_to_rest


def write_user_labels(case: CaseFolder, drawn: Mapping[str, UserLabels], matrix: FloatArray) -> list[str]:
    """Writes STATE_user.nii.gz in the rest frame, and user_labels.json saying what they hold; removes earlier ones."""
    names = []
    for state, labels in drawn.items():
        volume = labels.volume.moved(matrix) if state == "deformed" else labels.volume
        names.append(f"{state}_user.nii.gz")
        with case.atomic_path(names[-1]) as temporary:
            write_labels(temporary, volume)
    for state in {"rest", "deformed"} - set(drawn):
        case.remove(f"{state}_user.nii.gz")
    case.write_json("user_labels.json", {state: labels.to_dict() for state, labels in drawn.items()})
    return [*names, "user_labels.json"]


def write_landmarks(case: CaseFolder, points: Landmarks | None, matrix: FloatArray) -> list[str]:
    """Writes landmarks.csv with the deformed points in the rest frame, where there are points."""
    if points is None:
        return []
    case.write_text("landmarks.csv", landmarks_csv(points, matrix))
    return ["landmarks.csv"]
