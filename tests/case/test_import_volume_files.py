"""Two CTs in volume files to a case: everything but the exports that refer to DICOM images."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk
from bone_scans import bone_labels, largest_error, moving, scan
from phantoms import result

from palpate.case.case_folder import CaseFolder
from palpate.case.deformed_states import NewState, add_state
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.case.steps.import_scans.rest_only import import_alone
from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import write_labels, write_nifti
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume
from palpate.ui import export

TRUTH = moving((2.0, -1.0, 3.0), (4.0, 2.0, -6.0))


def in_air(ct: Volume) -> Volume:
    array = ct.array.copy()
    array[:4], array[-4:] = -1000, -1000
    return ct.with_array(array)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    folder = tmp_path_factory.mktemp("volumes")
    sitk.WriteImage(in_air(scan()).to_sitk(), str(folder / "rest.mha"), useCompression=True)
    write_nifti(folder / "deformed.nii.gz", in_air(scan(TRUTH)))
    yield folder / "rest.mha", folder / "deformed.nii.gz"


@pytest.fixture(scope="module")
def case(pair: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    folder = tmp_path_factory.mktemp("made") / "case"
    labels = bone_labels(scan()).array.copy()
    labels[30:36, 20:26, 10:14], labels[36:42, 20:26, 10:14] = 2, 1
    write_labels(folder.parent / "l.nii.gz", scan().with_array(labels))
    run_import(*pair, folder, ImportOptions(labels=(folder.parent / "l.nii.gz", None)))
    made = CaseFolder(folder)
    made.write_labels("rest", scan().with_array(labels))
    made.write_json("result.json", result())
    made.write_bytes("report/report.pdf", b"%PDF-1.4 a report")
    return made


def test_a_pair_of_volume_files_becomes_a_case(pair: tuple[Path, Path], case: CaseFolder) -> None:
    assert largest_error(case.deformed_to_rest(), TRUTH) < 0.2
    np.testing.assert_array_equal(case.ct("rest").array, in_air(scan()).array)
    np.testing.assert_array_equal(case.series("deformed")[0].array, in_air(scan(TRUTH)).array)
    assert [p.name for p in case.file("rest_ct").iterdir()] == ["ct.nrrd"]
    assert case.facts.gravity_rest is None
    notes = case.read_json("import.json")["notes"]
    assert sum("it is no DICOM: patient, date and position" in note for note in notes) == 2
    assert "a scan that is no DICOM has no UIDs: that they are two scans was told by their voxels" in notes


def test_a_rerun_does_nothing_and_another_is_refused(pair: tuple[Path, Path], case: CaseFolder, tmp_path: Path) -> None:
    told: list[str] = []
    options = ImportOptions(labels=(case.path.parent / "l.nii.gz", None))
    run_import(*pair, case.path, options, lambda fraction, message: told.append(message))
    assert told == ["already imported"]
    with pytest.raises(InputError, match="is the case of other scans"):
        run_import(pair[1], pair[0], case.path, options)


@pytest.mark.parametrize("form", [name for name in export.names() if name.startswith(("dicom", "rtstruct"))])
def test_exports_that_refer_to_images_say_why_not(form: str, case: CaseFolder, tmp_path: Path) -> None:
    with pytest.raises(
        InputError, match=r"the (rest|deformed) scan was no DICOM, so nothing can refer to it"
    ) as caught:
        export.exporter(form).export(case, tmp_path)
    assert "\n" not in str(caught.value) and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("form", ["itksnap", "nrrd", "transform"])
def test_other_exports_write_what_they_write(form: str, case: CaseFolder, tmp_path: Path) -> None:
    assert all(path.is_file() for path in export.exporter(form).export(case, tmp_path))


def test_a_volume_file_goes_with_a_dicom_folder_and_alone(pair: tuple[Path, Path], tmp_path: Path) -> None:
    who = SeriesIdentity("P1", "Rossi^Mario", "study", "rest", "rest", 1, "study", "rest", "made for a test")
    write_ct_series(tmp_path / "rest", in_air(scan()), who, compress=False)
    summary = run_import(tmp_path / "rest", pair[1], tmp_path / "mixed", ImportOptions(align=False))
    assert any("no UIDs" in note for note in summary["notes"])
    with pytest.raises(InputError, match="hold the same voxels under two names"):
        run_import(tmp_path / "rest", pair[0], tmp_path / "same")
    import_alone(pair[1], tmp_path / "alone")
    assert CaseFolder(tmp_path / "alone").ct("rest").array.shape == scan().array.shape


def test_a_ct_and_labels_are_no_pair(pair: tuple[Path, Path], tmp_path: Path) -> None:
    write_labels(tmp_path / "labels.nii.gz", bone_labels(scan()))
    with pytest.raises(InputError, match=r"rest\.mha is a CT and .*labels\.nii\.gz holds labels; give two CTs"):
        run_import(pair[0], tmp_path / "labels.nii.gz", tmp_path / "case")
    assert not (tmp_path / "case").exists()


def test_a_further_state_may_be_a_volume_file(pair: tuple[Path, Path], case: CaseFolder, tmp_path: Path) -> None:
    moved = case.labels("rest").moved(np.linalg.inv(TRUTH))
    array = np.roll(moved.array, 1, axis=0)
    write_labels(tmp_path / "more.nii.gz", moved.with_array(array))
    with pytest.raises(InputError, match="labels drawn on a further deformed CT are needed"):
        add_state(case, NewState(pair[1]))
    state = add_state(case, NewState(pair[1], labels=tmp_path / "more.nii.gz", align=False))
    assert case.file(state.labels).is_file()
