"""Further deformed states of a case: label volumes and landmarks beyond those of the first pair.

`states` in case.json (docs/case.md) lists them: {"name": "full bladder", "labels": "deformed_2.nii.gz",
"landmarks": "landmarks_2.csv"}; landmarks are optional. The first deformed state is deformed.nii.gz with landmarks.csv.
All files lie in the frame of the scan at rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.case.case_folder import CaseFolder, check_new_case, file_sha256
from palpate.case.landmarks import Landmarks, landmarks_csv, read_landmarks
from palpate.case.rigid_offset import RigidOffset, rigid_offset_in
from palpate.case.stated_files import FurtherState, checked_state, state_entries, stated_states
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.json_types import plain
from palpate.imaging.contours.itksnap_labels import label_values
from palpate.imaging.contours.nifti_labels import read_labels, write_labels
from palpate.imaging.contours.user_labels import files_of, read_label_volume, read_user_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.labels import BONE, ORGAN_LABELS
from palpate.imaging.registration.align_on_bone import align_ct, align_labels
from palpate.imaging.scans.scan import is_ct, read_scan
from palpate.imaging.volume import Volume


def state_labels(case: CaseFolder, state: FurtherState) -> Volume:
    """Label volume of a further state in the rest frame, axes in LPS order; its rigid offset is removed.

    Raises InputError when the file holds no prostate (labels 1, 2).
    """
    volume = _stored_labels(case, state)
    offset = rigid_offset_in(case, volume)
    return volume if offset is None else volume.moved(offset.deformed_to_rest)


def state_rigid_offset(case: CaseFolder, state: FurtherState) -> RigidOffset | None:
    """Rigid offset of a further state's stored labels from the rest frame; None where they are aligned.

    `state_labels` and `state_landmarks` have already removed it.
    """
    return rigid_offset_in(case, _stored_labels(case, state))


def _stored_labels(case: CaseFolder, state: FurtherState) -> Volume:
    values = label_values(case.file("labels.txt")) if case.has("labels.txt") else None
    volume = in_lps_order(read_labels(case.file(state.labels), values))
    if not np.isin(volume.array, ORGAN_LABELS).any():
        raise InputError(f"{case.file(state.labels)} holds no prostate (labels 1, 2); draw it")
    return volume


def state_landmarks(case: CaseFolder, state: FurtherState) -> Landmarks | None:
    """Landmarks of a further state, both sets of points in the rest frame (LPS, mm); None where it has none."""
    if state.landmarks is None:
        return None
    marks, offset = read_landmarks(case.file(state.landmarks)), state_rigid_offset(case, state)
    return marks if offset is None else replace(marks, deformed=offset.back(marks.deformed))


@dataclass(frozen=True)
class NewState:
    """Files of a deformed state to add.

    scan : label volume, or CT. labels : contours drawn on that CT; required with a CT.
    landmarks : CSV file, deformed points in this scan's own coordinates (LPS, mm). align : False where the scan already
    lies in the frame of the scan at rest.
    """

    scan: Path
    labels: Path | None = None
    landmarks: Path | None = None
    align: bool = True


def add_state(case: CaseFolder, new: NewState) -> FurtherState:
    """The deformed state that was added to the case; its files are written and case.json lists it.

    Precondition: the case has been imported. Adding the same files again changes nothing and returns the earlier state.
    Only the labels of a CT are kept. Raises InputError when labels are missing, when CTs show no bone to align on, when
    a file cannot be read, when the labels equal those of the first deformed state, or when the case lies inside the scan.
    """
    check_new_case(case.path, [new.scan])
    drawn = new.labels or new.scan
    read = [*(files_of(drawn) if drawn.is_file() else ()), *([] if new.landmarks is None else [new.landmarks])]
    source, known = tuple(file_sha256(path) for path in read if path.is_file()), stated_states(case)
    for state in known:
        if state.source_sha256 == source:
            return checked_state(case, state)
    volume, matrix = _aligned(case, new)
    if case.has_labels("deformed") and np.array_equal(in_lps_order(volume).array, case.labels("deformed").array):
        raise InputError(
            f"{new.labels or new.scan} holds the same labels as the first deformed state; it would count twice"
        )
    points = None if new.landmarks is None else read_landmarks(new.landmarks)
    number = 2 + len(known)
    labels, marks = f"deformed_{number}.nii.gz", None if points is None else f"landmarks_{number}.csv"
    with case.atomic_path(labels) as temporary:
        write_labels(temporary, volume.moved(matrix))
    if points is not None and marks is not None:
        case.write_text(marks, landmarks_csv(points, matrix))
    state = FurtherState(labels, f"deformed {number}", source, marks)
    entries = [*state_entries(case), plain(state)]
    case.save_facts(replace(case.facts, other={**case.facts.other, "states": entries}))
    return state


def _aligned(case: CaseFolder, new: NewState) -> tuple[Volume, FloatArray]:
    """Labels in the state's own frame, and the rigid transform (4, 4), mm, from there into the rest frame."""
    if not new.scan.exists():
        raise InputError(f"{new.scan} is not there; give a label volume or a CT")
    if is_ct(new.scan):
        if new.labels is None:
            raise InputError(
                f"{new.scan}: labels drawn on a further deformed CT are needed; give them with --more-labels"
            )
        ct, facts = read_scan(new.scan)
        volume = read_user_labels(new.labels, ct, facts).volume
        matrix = align_ct(case.ct("rest"), ct).deformed_to_rest if new.align else np.eye(4)
    else:
        if not case.has_labels("rest"):
            raise InputError(
                f"{new.scan}: the scan at rest is a CT, so give this state as a CT too, with --more-labels"
            )
        volume = read_label_volume(new.scan).volume
        rest = case.labels("rest")
        both = all((v.array == BONE).any() for v in (rest, volume))
        matrix = align_labels(rest, volume).deformed_to_rest if new.align and both else np.eye(4)
    if not np.isin(volume.array, ORGAN_LABELS).any():
        raise InputError(f"{new.labels or new.scan} holds no prostate (labels 1, 2); draw it")
    return volume, matrix
