"""Asymmetric cases with both scans as DICOM, of a patient with a name."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pydicom
from phantoms import MARKER, labels, lps, marked_ct, result
from scipy.spatial.transform import Rotation

from palpate.case.case_folder import CaseFacts, CaseFolder
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume

NAME, NUMBER = "Müller^Jörg", "4711-XYZ"
FLIPS = list(itertools.product((1, -1), repeat=3))
TURN = np.eye(4)
TURN[:3, :3] = Rotation.from_rotvec([0.03, -0.05, 0.08]).as_matrix()
TURN[:3, 3] = [4.0, -7.0, 11.0]


def who(series: str) -> SeriesIdentity:
    return SeriesIdentity(NUMBER, "Doe^Jane", "s", series, series, 1, "study", "CT pelvis", "drawn by a test")


def name_patient(folder: Path, name: str) -> None:
    for path in folder.iterdir():
        dataset = pydicom.dcmread(path)
        dataset.SpecificCharacterSet, dataset.PatientName, dataset.PatientBirthDate = "ISO_IR 100", name, "19501231"
        dataset.save_as(path)


def anatomy(matrix: np.ndarray, push_mm: float = 0.0) -> Volume:
    """Labels without any symmetry: the bladder is where the CT's marker is, to the left, in front and above."""
    drawn = labels(matrix, push_mm=push_mm)
    far = np.linalg.norm(lps(matrix) - MARKER, axis=-1)
    return drawn.with_array(np.where(far < 7.0, 5, drawn.array).astype(np.uint8))


def pair(folder: Path, matrix: np.ndarray, deformed: bool = True) -> CaseFolder:
    """Labels on the CT's own grid, which lies as ``matrix`` says; the deformed scan, if wanted, turned against it."""
    case = CaseFolder.create(folder, CaseFacts("phantom"))
    write_ct_series(case.file("rest_ct"), marked_ct(matrix), who("rest"), compress=False)
    case.write_labels("rest", anatomy(matrix))
    if deformed:
        moved = anatomy(matrix, push_mm=3.0)
        write_ct_series(case.file("deformed_ct"), moved.moved(np.linalg.inv(TURN)), who("deformed"), compress=False)
        case.write_labels("deformed", moved)
    case.write_json("alignment.json", {"deformed_to_rest": TURN, "residual_mm": 0.1})
    case.write_json("result.json", result())
    case.write_bytes("report/report.pdf", b"%PDF-1.4 a report")
    for state in ("rest", "deformed")[: 1 + deformed]:
        name_patient(case.file(f"{state}_ct"), NAME)
    return case
