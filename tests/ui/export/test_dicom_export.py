"""DICOM out: same values, same place, the scan's own patient and frame, marked for research, valid."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import highdicom as hd
import numpy as np
import pydicom
import pytest
import SimpleITK as sitk
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fixtures"))
from dicom_cases import FLIPS, NAME, NUMBER, TURN, name_patient, pair
from dicom_samples import enhanced_ct, straight
from phantoms import CENTRE, MARKER, affine, result, write_case

from palpate.case.case_folder import CaseFacts, CaseFolder
from palpate.case.labels_on_scan import without_tissue
from palpate.core.errors import InputError
from palpate.imaging.volume import Volume
from palpate.ui.cli import main as cli
from palpate.ui.dicom.codes import TG263
from palpate.ui.export import exporter

FORMS = ("dicom-seg", "dicom-pm", "dicom-sr", "dicom-pdf", "dicom-reg", "rtstruct")


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    return pair(tmp_path_factory.mktemp("dicom") / "case", affine(rotation_deg=9.0, flips=(1, -1, -1)))


@pytest.fixture(scope="module")
def written(case: CaseFolder, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("out")
    return {path.name: path for form in FORMS for path in exporter(form).export(case, folder)}


def places(volume: Volume, inside: np.ndarray) -> np.ndarray:
    """Patient coordinates of voxels, 0.01 mm, sorted: the same set wherever and however it is stored."""
    return np.unique(np.round(volume.to_lps(np.argwhere(inside).astype(float)), 2) + 0.0, axis=0)


def assert_same_places(one: np.ndarray, other: np.ndarray) -> None:
    assert one.shape == other.shape
    assert cKDTree(one).query(other)[0].max() < 0.06
    assert cKDTree(other).query(one)[0].max() < 0.06


def volume_of(found: hd.Volume) -> Volume:
    return Volume(np.transpose(found.array, (2, 1, 0)), found.affine[:, [2, 1, 0, 3]])


def assert_segments_are(path: Path, wanted: Volume) -> None:
    """Every organ of the labels, voxel by voxel; the surrounding tissue is none."""
    found = hd.seg.segread(path)
    wanted = without_tissue(wanted, False)
    assert {TG263[int(v)] for v in np.unique(wanted.array) if v} == {s.SegmentLabel for s in found.SegmentSequence}
    for item in found.SegmentSequence:
        value = next(v for v, name in TG263.items() if name == item.SegmentLabel)
        volume = volume_of(found.get_volume(segment_numbers=[item.SegmentNumber], combine_segments=True, relabel=True))
        assert_same_places(places(volume, volume.array > 0), places(wanted, wanted.array == value))


@pytest.mark.parametrize("flips", FLIPS)
def test_every_object_lies_where_it_lay_in_all_eight_flips(flips: tuple[int, int, int], tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine(flips=flips), deformed=False)
    seg, pm = exporter("dicom-seg").export(case, tmp_path)[0], exporter("dicom-pm").export(case, tmp_path)[0]
    wanted = case.labels("rest")
    assert_segments_are(seg, wanted)
    G = volume_of(hd.imread(pm).get_volume())
    for value, kpa in ((1, 120.0), (2, 40.0)):
        assert_same_places(places(G, np.float32(kpa) == G.array), places(wanted, wanted.array == value))
    # SimpleITK's CT and our objects in one space: the marker is where it was drawn, and the left half beside it.
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(case.file("rest_ct"))))
    ct = Volume.from_sitk(reader.Execute())
    np.testing.assert_allclose(places(ct, ct.array > 500).mean(axis=0), MARKER, atol=0.75)
    assert places(G, G.array == 120).mean(axis=0)[0] > CENTRE[0] > places(G, G.array == 40).mean(axis=0)[0]


def test_an_oblique_scan_keeps_its_place_and_the_deformed_labels_lie_in_their_own_scan(
    case: CaseFolder, written: dict[str, Path]
) -> None:
    assert_segments_are(written["rest_seg.dcm"], case.labels("rest"))
    assert_segments_are(written["deformed_seg.dcm"], case.labels("deformed").moved(np.linalg.inv(TURN)))
    frames = {p: pydicom.dcmread(path).FrameOfReferenceUID for p, path in written.items() if "seg" in p or "pm" in p}
    own = {s: pydicom.dcmread(next(case.file(f"{s}_ct").iterdir())).FrameOfReferenceUID for s in ("rest", "deformed")}
    at_rest = ("rest_seg.dcm", "stiffness_pm.dcm", "stiffness_low_pm.dcm", "stiffness_high_pm.dcm")
    assert frames == dict.fromkeys(at_rest, own["rest"]) | {"deformed_seg.dcm": own["deformed"]}


def test_labels_beyond_the_last_slice_are_left_out(tmp_path: Path) -> None:
    """The model's labels go on where the scan has ended; a viewer would show them in empty space."""
    case = pair(tmp_path / "case", affine(), deformed=False)
    labels, top = without_tissue(case.labels("rest"), False), sorted(case.file("rest_ct").iterdir())
    z = {path: float(pydicom.dcmread(path).ImagePositionPatient[2]) for path in top}
    middle = np.median(sorted(z.values()))
    for path in [path for path in top if z[path] > middle]:
        path.unlink()
    assert (places(labels, labels.array > 0)[:, 2] > middle + 1.5).any()
    found = hd.seg.segread(exporter("dicom-seg").export(case, tmp_path / "out")[0]).get_volume(combine_segments=True)
    kept = places(volume_of(found), volume_of(found).array > 0)
    inside = places(labels, labels.array > 0)
    assert_same_places(kept, inside[inside[:, 2] < middle + 1.5])


def test_pydicom_and_simpleitk_see_the_same_pixels(written: dict[str, Path]) -> None:
    """SimpleITK reads no floating-point pixels, hence no Parametric Map: for it there is the series (test_stiffness_series)."""
    other = sitk.GetArrayFromImage(sitk.ReadImage(str(written["rest_seg.dcm"]))) > 0
    own = pydicom.dcmread(written["rest_seg.dcm"]).pixel_array > 0
    # GDCM misreads the bits of a last byte that the frames do not fill.
    whole = own.size // 8 * 8
    np.testing.assert_array_equal(own.ravel()[:whole], other.ravel()[:whole])


def test_the_map_says_kilopascal(written: dict[str, Path]) -> None:
    found = pydicom.dcmread(written["stiffness_pm.dcm"])
    mapping = found.SharedFunctionalGroupsSequence[0].RealWorldValueMappingSequence[0]
    unit = mapping.MeasurementUnitsCodeSequence[0]
    assert (unit.CodeValue, unit.CodingSchemeDesignator) == ("kPa", "UCUM")
    assert (mapping.RealWorldValueSlope, mapping.RealWorldValueIntercept) == (1.0, 0.0)
    assert mapping.DoubleFloatRealWorldValueLastValueMapped == 120.0
    assert "shear modulus" in mapping.QuantityDefinitionSequence[0].ConceptCodeSequence[0].CodeMeaning
    assert found.ContentQualification == "RESEARCH"
    assert np.unique(found.pixel_array).tolist() == [0.0, 40.0, 120.0]


def test_measurements_by_region_with_interval(written: dict[str, Path]) -> None:
    document = hd.sr.srread(written["measurements_sr.dcm"])
    segments = pydicom.dcmread(written["rest_seg.dcm"])
    seen = {}
    for group in document.content.get_volumetric_roi_measurement_groups():
        found = {m.name.meaning: m.value for m in group.get_measurements() if m.derivation is None}
        assert {m.unit.value for m in group.get_measurements()} == {"kPa"}
        deviation = [m.value for m in group.get_measurements() if m.derivation is not None]
        region = group.referenced_segment[0]
        assert region.referenced_sop_instance_uid == segments.SOPInstanceUID
        number = region.referenced_segment_numbers[0]
        assert segments.SegmentSequence[number - 1].TrackingID == group.tracking_identifier
        side = group.finding_sites[0].laterality.meaning
        seen[side] = [*(round(float(v), 3) for v in found.values()), float(deviation[0])]
        assert next(iter(found)) == "Small-strain shear modulus G"
    assert seen == {"Left": [120.0, 100.0, 144.0, 12.0], "Right": [40.0, 33.33, 48.0, 4.0]}
    texts = [item.TextValue for item in document.ContentSequence if item.ValueType == "TEXT"]
    assert "Research use only" in texts[-1] and "20 kPa" in texts[-1]


def test_the_pdf_is_the_report(written: dict[str, Path]) -> None:
    found = pydicom.dcmread(written["report_pdf.dcm"])
    assert found.EncapsulatedDocument[: found.EncapsulatedDocumentLength] == b"%PDF-1.4 a report"
    assert found.MIMETypeOfEncapsulatedDocument == "application/pdf" and "RESEARCH" in found.DocumentTitle


def test_all_refer_to_the_scan_and_keep_its_patient_in_headers_only(case: CaseFolder, written: dict[str, Path]) -> None:
    sources = {s: [pydicom.dcmread(p) for p in case.file(f"{s}_ct").iterdir()] for s in ("rest", "deformed")}
    for name, path in written.items():
        found = pydicom.dcmread(path)
        scan = sources["deformed" if name.startswith("deformed") else "rest"]
        assert (str(found.PatientName), found.PatientID, found.PatientBirthDate) == (NAME, NUMBER, "19501231")
        assert found.StudyInstanceUID == scan[0].StudyInstanceUID
        assert "RESEARCH USE ONLY" in found.SeriesDescription
        text = str(found)
        assert sum(str(image.SOPInstanceUID) in text for image in scan) > 0.3 * len(scan), name
        found.PatientName = found.PatientID = found.PatientBirthDate = ""
        assert "ller" not in str(found) and NUMBER not in str(found) and "19501231" not in str(found)
        assert "ller" not in path.name and NUMBER not in path.name


def test_the_same_case_gives_the_same_objects(
    case: CaseFolder, written: dict[str, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for form in FORMS:
        assert cli.main(["export", str(case.path), "--to", form, str(tmp_path), "--json"]) == 0
        output = capfd.readouterr()
        assert NUMBER not in output.out + output.err and "ller" not in output.out + output.err
        for path in map(Path, json.loads(output.out)["files"]):
            assert path.read_bytes() == written[path.name].read_bytes()


@pytest.mark.skipif(shutil.which("dciodvfy") is None, reason="dciodvfy is absent: apt-get install dicom3tools")
def test_dciodvfy_finds_no_error(written: dict[str, Path]) -> None:
    assert len(written) == 10
    assert_valid(written)


def assert_valid(files: dict[str, Path]) -> None:
    if shutil.which("dciodvfy") is None:
        return
    for name, path in files.items():
        said = subprocess.run(["dciodvfy", str(path)], capture_output=True, text=True, check=False)
        errors = [line for line in (said.stdout + said.stderr).splitlines() if line.startswith(("Error", "Abort"))]
        assert errors == [], name


def test_a_scan_with_missing_and_malformed_headers(tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine())
    for path in case.file("rest_ct").iterdir():
        dataset = pydicom.dcmread(path)
        del dataset.StudyTime, dataset.AccessionNumber, dataset.StudyID, dataset.ReferringPhysicianName
        del dataset.SliceThickness, dataset.BodyPartExamined, dataset.PatientBirthDate, dataset.Manufacturer
        dataset.PatientSex, dataset.TimezoneOffsetFromUTC = "U", "+0530"
        dataset.save_as(path)
    files = [p for form in FORMS for p in exporter(form).export(case, tmp_path / "out")]
    assert all(pydicom.dcmread(path).PatientSex == "O" for path in files if not path.name.startswith("deformed"))
    found = pydicom.dcmread(tmp_path / "out" / "measurements_sr.dcm")
    made = datetime.strptime(f"{found.ContentDate}{found.ContentTime}+0530", "%Y%m%d%H%M%S%z").timestamp()
    assert found.TimezoneOffsetFromUTC == "+0530"
    assert made == max(int(case.file(name).stat().st_mtime) for name in ("result.json", "rest.nii.gz", "labels.txt"))
    for name in ("rest_seg.dcm", "stiffness_pm.dcm"):
        shared = pydicom.dcmread(tmp_path / "out" / name).SharedFunctionalGroupsSequence[0]
        assert shared.PixelMeasuresSequence[0].SliceThickness == case.labels("rest").spacing[2] == 3.0


def test_a_scan_in_one_multi_frame_file(tmp_path: Path) -> None:
    case = CaseFolder.create(tmp_path / "case", CaseFacts("multi-frame"))
    case.file("rest_ct").mkdir()
    enhanced_ct(straight(8)).save_as(case.file("rest_ct") / "0001.dcm")
    grid = case.ct("rest")
    array = np.full(grid.array.shape, 3, dtype=np.uint8)
    array[4:10, 5:12, 2:6], array[10:14, 5:12, 2:5] = 1, 2
    case.write_labels("rest", grid.with_array(array))
    case.write_json("result.json", result())
    case.write_bytes("report/report.pdf", b"%PDF-1.4 a report")
    forms = [form for form in FORMS if form != "dicom-reg"]  # which is of two scans
    files = {path.name: path for form in forms for path in exporter(form).export(case, tmp_path / "out")}
    assert_valid(files)
    assert_segments_are(files["rest_seg.dcm"], case.labels("rest"))


def test_an_odd_name_reaches_no_terminal(case: CaseFolder, tmp_path: Path) -> None:
    """Libraries quote a name without carets in their warnings."""
    folder = tmp_path / "case"
    shutil.copytree(case.path, folder)
    name_patient(folder / "rest_ct", "Oddname")
    each = f"for form in {FORMS}: main(['export', {str(folder)!r}, '--to', form, {str(tmp_path / 'out')!r}])"
    code = f"from palpate.ui.cli.main import main\n{each}"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "report_pdf.dcm" in said.stdout and "Oddname" not in said.stdout + said.stderr
    assert str(pydicom.dcmread(tmp_path / "out" / "rest_seg.dcm").PatientName) == "Oddname"


def test_refusals_in_one_line(tmp_path: Path) -> None:
    case = write_case(tmp_path / "case", ct=False)
    for form in ("dicom-seg", "dicom-pm", "dicom-sr", "rtstruct"):
        with pytest.raises(InputError, match=r"(rest_ct is not there|no state with both labels and a CT)"):
            exporter(form).export(case, tmp_path / "out")
    with pytest.raises(InputError, match=r"report\.pdf is not there; run `palpate report` first"):
        exporter("dicom-pdf").export(case, tmp_path / "out")
    with_ct = pair(tmp_path / "other", affine())
    path = next(with_ct.file("rest_ct").iterdir())
    dataset = pydicom.dcmread(path)
    del dataset.FrameOfReferenceUID
    dataset.save_as(path)
    with pytest.raises(InputError, match="lacks FrameOfReferenceUID"):
        exporter("dicom-pm").export(with_ct, tmp_path / "out")
