"""What makes two series a pair."""

from __future__ import annotations

from pathlib import Path

import pytest
from dicom_samples import PATIENT_ID, hounsfield, save, series, straight

from palpate.core.errors import InputError
from palpate.imaging.dicom.pair_check import check_pair
from palpate.imaging.dicom.series import SeriesFacts, read_series
from palpate.imaging.volume import Volume


def scan(folder: Path, uid: str, shift: float = 0.0, **elements: object) -> tuple[Volume, SeriesFacts]:
    slices = series(straight(), series=uid, values=lambda p: hounsfield(p) + shift)
    for one in slices:
        for keyword, value in elements.items():
            setattr(one, keyword, value)
    return read_series(save(folder, slices))


def test_two_scans_of_one_patient(tmp_path: Path) -> None:
    other = scan(tmp_path / "b", "1.2", 3.0, PatientName="ROSSI^Mario ")
    assert check_pair(scan(tmp_path / "a", "1.1"), other) == []


def test_one_scan_twice_is_refused(tmp_path: Path) -> None:
    first = scan(tmp_path / "a", "1.1")
    with pytest.raises(InputError, match="hold the same scan; give a scan at rest and another one"):
        check_pair(first, first)
    with pytest.raises(InputError, match="hold the same voxels under two names"):
        check_pair(first, scan(tmp_path / "b", "1.2"))


def test_two_patients_are_refused_unless_vouched_for(tmp_path: Path) -> None:
    first, second = scan(tmp_path / "a", "1.1"), scan(tmp_path / "b", "1.2", 3.0, PatientID="Y-12")
    with pytest.raises(InputError, match=r"are of two patients by number or name; .* --same-patient") as caught:
        check_pair(first, second)
    assert PATIENT_ID not in str(caught.value) and "Y-12" not in str(caught.value)
    assert check_pair(first, second, same_patient=True) == []


def test_unnamed_patients_and_far_dates_are_noted(tmp_path: Path) -> None:
    first = scan(tmp_path / "a", "1.1")
    second = scan(tmp_path / "b", "1.2", 3.0, PatientID="", PatientName="", StudyDate="20240702")
    notes = check_pair(first, second)
    assert "does not name its patient" in notes[0] and "182 days apart" in notes[1]
