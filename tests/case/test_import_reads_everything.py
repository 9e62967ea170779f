"""An import stands on every file that was read: label names beside a volume, a workspace's volume; and on who was scanned when."""

from __future__ import annotations

from pathlib import Path

import pydicom
import pytest
from bone_scans import moving
from bone_scans import scan as bone_scan
from contour_files import SIZES, change, counts, label_names, nifti, outlines, rtstruct, scan
from dicom_samples import save, series, straight
from drawn_contours import user_labels

from palpate.case.case_folder import CaseFolder
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.case.steps.import_scans.rest_only import import_alone
from palpate.core.errors import InputError
from palpate.imaging.contours.itksnap_workspace import LABEL_LAYER, MAIN, Layer, workspace_text
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.ui.cli.main import main
from palpate.validate.segmentation.contoured_scan import contoured_scan

VALUES = {"prostate": 1, "bladder": 2, "rectum": 3}
FIRST, CORRECTED = {1: "Blase", 2: "Prostata", 3: "Rektum"}, {1: "Prostata", 2: "Blase", 3: "Rektum"}


def held(case: Path) -> dict[int, int]:
    labels = user_labels(CaseFolder(case), "rest") or CaseFolder(case).labels("rest")
    return counts(labels)


def test_corrected_label_names_are_read_anew(tmp_path: Path) -> None:
    folder, _, _ = scan(tmp_path / "ct")
    drawn = nifti(tmp_path / "l.nii.gz", VALUES)
    options = ImportOptions(labels=(drawn, None))
    for alone, case in ((folder, tmp_path / "of a scan"), (drawn, tmp_path / "of labels")):
        for names, prostate in ((FIRST, "bladder"), (CORRECTED, "prostate")):
            label_names(tmp_path, names)
            for _ in range(2):
                import_alone(alone, case, options if alone == folder else None)
                assert held(case)[1] == SIZES[prostate]


def test_a_workspace_is_read_anew_when_its_volume_changes(tmp_path: Path) -> None:
    folder, volume, _ = scan(tmp_path / "ct")
    path = tmp_path / "a.itksnap"
    layers = [Layer(tmp_path / "ct.nii.gz", MAIN), Layer(tmp_path / "w.nii.gz", LABEL_LAYER)]
    path.write_text(workspace_text(layers, tmp_path, volume.array.shape))
    for values in ({"prostate": 1, "bladder": 5}, {"prostate": 5, "bladder": 1}):
        nifti(tmp_path / "w.nii.gz", values)
        import_alone(folder, tmp_path / "case", ImportOptions(labels=(path, None)))
        assert held(tmp_path / "case")[1] == next(SIZES[organ] for organ, value in values.items() if value == 1)


def test_two_label_volumes_are_read_anew_and_by_the_callers_choice(tmp_path: Path) -> None:
    rest = nifti(tmp_path / "rest.nii.gz", VALUES)
    deformed = nifti(tmp_path / "deformed.nii.gz", {**VALUES, "rectum": 0})
    label_names(tmp_path, FIRST)
    run_import(rest, deformed, tmp_path / "case")
    assert counts(CaseFolder(tmp_path / "case").labels("rest"))[1] == SIZES["bladder"]
    label_names(tmp_path, CORRECTED)
    notes = run_import(rest, deformed, tmp_path / "case")["notes"]
    assert counts(CaseFolder(tmp_path / "case").labels("rest"))[1] == SIZES["prostate"]
    assert "rest: prostate is Prostata" in notes
    run_import(rest, deformed, tmp_path / "case", ImportOptions(roi={"prostate": ["Rektum"]}))
    assert counts(CaseFolder(tmp_path / "case").labels("rest"))[1] == SIZES["rectum"]


def test_two_dates_of_one_patient_that_share_no_pelvis(tmp_path: Path) -> None:
    """The second scan lies a pelvis further up."""
    for word, moved, date in (("rest", 0.0, "20240102"), ("deformed", 400.0, "20240305")):
        who = SeriesIdentity("P1", "Rossi^Mario", "study", word, word, 1, "study", word, "made for a test")
        volume = bone_scan(moving((0.0, 0.0, 0.0), (0.0, 0.0, moved)), lowest=-48.0)
        write_ct_series(tmp_path / word, volume, who, compress=False)
        for path in (tmp_path / word).iterdir():
            header = pydicom.dcmread(path)
            change([header], StudyDate=date)
            header.save_as(path)
    with pytest.raises(InputError, match="one patient, of 20240102 and 20240305, but share no pelvis") as refused:
        run_import(tmp_path / "rest", tmp_path / "deformed", tmp_path / "case")
    assert "Rossi" not in str(refused.value)


def test_studies_take_the_callers_structures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = save(tmp_path / "ct", series(straight(8)))
    sets = {f"Rectum_{word}": outlines("bladder") for word in ("DL", "MBS")}
    path, _ = rtstruct(tmp_path / "rs.dcm", {"Prostata": outlines("prostate"), "Anorect 1": outlines("rectum"), **sets})
    with pytest.raises(InputError, match="several structures for rectum"):
        contoured_scan(folder, path, "scan 1")
    found = contoured_scan(folder, path, "scan 1", {"rectum": ["Anorect 1"]})
    assert int(found.masks["rectum"].array.sum()) == SIZES["rectum"]
    assert main(["validate", "segmentation", "--roi", "rectum=Anorect 1"]) == 2
    assert "--roi needs --scan" in capsys.readouterr().err
    assert main(["validate", "segmentation", "--scan", str(folder), str(path), "--roi", "rectum=nothing"]) == 3
    assert "has no structure 'nothing'" in capsys.readouterr().err
