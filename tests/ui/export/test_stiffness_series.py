"""The stiffness as a series of slices: what SimpleITK reads is what was identified, where it was; valid and marked."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fixtures"))
from dicom_cases import FLIPS, NAME, NUMBER, pair
from phantoms import affine, result

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.ui.export import exporter


def by_simpleitk(folder: Path) -> Volume:
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    return Volume.from_sitk(reader.Execute())


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    return pair(tmp_path_factory.mktemp("series") / "case", affine(rotation_deg=9.0, flips=(1, -1, -1)))


@pytest.mark.parametrize("flips", FLIPS)
def test_simpleitk_reads_the_same_values_in_the_same_place(flips: tuple[int, int, int], tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine(rotation_deg=5.0, flips=flips), deformed=False)
    files = exporter("dicom-series").export(case, tmp_path)
    found, labels = by_simpleitk(files[0].parent), case.labels("rest")
    for value, kpa in ((1, 120.0), (2, 40.0)):
        voxels = np.argwhere(labels.array == value)
        there = np.rint(found.to_index(labels.to_lps(voxels.astype(float)))).astype(int)
        np.testing.assert_allclose(found.array[tuple(there.T)], kpa, atol=0.005)
        assert np.isclose(found.array, kpa, atol=0.005).sum() == len(voxels)
        np.testing.assert_allclose(found.to_lps(there.astype(float)), labels.to_lps(voxels.astype(float)), atol=0.01)


def test_a_value_with_decimals_is_kept_to_half_a_step(case: CaseFolder, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    shutil.copytree(case.path, folder)
    changed = CaseFolder(folder)
    facts = result()
    facts["parameters"]["prostate_left"]["G_kpa"] = 31.41592
    facts["parameters"]["prostate_right"]["G_kpa"] = 7.38906
    changed.write_json("result.json", facts)
    found = by_simpleitk(exporter("dicom-series").export(changed, tmp_path)[0].parent)
    np.testing.assert_allclose(np.unique(found.array), [0.0, 7.38906, 31.41592], atol=0.00051)


def test_it_says_what_it_is_and_whose(case: CaseFolder, tmp_path: Path) -> None:
    files = exporter("dicom-series").export(case, tmp_path)
    scan = pydicom.dcmread(next(case.file("rest_ct").iterdir()))
    found = pydicom.dcmread(files[3])
    assert (str(found.PatientName), found.PatientID) == (NAME, NUMBER)
    assert found.StudyInstanceUID == scan.StudyInstanceUID and found.SeriesInstanceUID != scan.SeriesInstanceUID
    assert found.RescaleType == "US"
    assert "RESEARCH USE ONLY" in found.SeriesDescription and "Research use only" in found.ImageComments
    mapping = found.RealWorldValueMappingSequence[0]
    assert mapping.MeasurementUnitsCodeSequence[0].CodeValue == "kPa"
    assert mapping.RealWorldValueSlope == float(found.RescaleSlope) == 0.01
    assert re.fullmatch(r"G_\d{3}\.dcm", files[3].name)
    again = exporter("dicom-series").export(case, tmp_path / "again")
    assert [f.read_bytes() for f in again] == [f.read_bytes() for f in files]


def test_nothing_of_it_can_be_taken_for_a_ct_to_plan_on(case: CaseFolder, tmp_path: Path) -> None:
    found = [pydicom.dcmread(file) for file in exporter("dicom-series").export(case, tmp_path)]
    scan = pydicom.dcmread(next(case.file("rest_ct").iterdir()))
    assert {image.SOPClassUID for image in found} == {pydicom.uid.SecondaryCaptureImageStorage}
    assert {image.Modality for image in found} == {"OT"} and "KVP" not in found[0]
    frames = {image.FrameOfReferenceUID for image in found}
    assert len(frames) == 1 and scan.FrameOfReferenceUID not in frames
    assert "not for planning" in found[0].ImageComments and "no Hounsfield units" in found[0].DerivationDescription
    # The grid is turned by 9 degrees and flipped along y and z: rows run to the left and a little to the front.
    assert [letters[0] for letters in found[0].PatientOrientation] == [
        "LPH"[i] if v > 0 else "RAF"[i]
        for row in np.reshape(found[0].ImageOrientationPatient, (2, 3)).astype(float)
        for i, v in [max(enumerate(row), key=lambda pair: abs(pair[1]))]
    ]


@pytest.mark.skipif(shutil.which("dciodvfy") is None, reason="dciodvfy is absent: apt-get install dicom3tools")
def test_dciodvfy_finds_no_error(case: CaseFolder, tmp_path: Path) -> None:
    for path in exporter("dicom-series").export(case, tmp_path)[:2]:
        said = subprocess.run(["dciodvfy", str(path)], capture_output=True, text=True, check=False)
        assert [line for line in (said.stdout + said.stderr).splitlines() if line.startswith(("Error", "Abort"))] == []


def test_without_a_ct_it_refuses(case: CaseFolder, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    shutil.copytree(case.path, folder, ignore=shutil.ignore_patterns("rest_ct"))
    with pytest.raises(InputError, match="rest_ct is not there"):
        exporter("dicom-series").export(CaseFolder(folder), tmp_path)
    assert not (tmp_path / "stiffness_series").exists()
