"""The scan at rest alone is a case for `plan`; with the second scan it becomes a pair in the same folder."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "fixtures"))
from dicom_cases import pair
from phantoms import affine

from palpate.case.case_folder import CaseFolder
from palpate.case.steps import mesh
from palpate.case.steps.import_scans.options import ImportOptions
from palpate.case.steps.import_scans.pair import run_import
from palpate.case.steps.import_scans.rest_only import import_alone
from palpate.case.steps.segment import run_segment
from palpate.core.errors import InputError
from palpate.ui.cli import main as cli


@pytest.fixture(scope="module")
def scans(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    return pair(tmp_path_factory.mktemp("alone") / "case", affine())


def test_a_label_volume_alone_is_enough_for_segment_and_tells_mesh_what_it_is(
    scans: CaseFolder, tmp_path: Path
) -> None:
    summary = import_alone(scans.file("rest.nii.gz"), tmp_path / "case")
    case = CaseFolder(tmp_path / "case")
    assert list(summary["sources_sha256"]) == ["rest"]
    np.testing.assert_array_equal(case.labels("rest").array, scans.labels("rest").array)
    assert run_segment(case)["states"] == {"rest": {"source": "label volumes"}}
    with pytest.raises(InputError, match="contains only the scan at rest; `palpate plan` works on it"):
        mesh.run(case)


def test_the_second_scan_joins_it_later(scans: CaseFolder, tmp_path: Path) -> None:
    folder = tmp_path / "case"
    first = import_alone(scans.file("rest_ct"), folder, ImportOptions(name="one"))
    assert import_alone(scans.file("rest_ct"), folder, ImportOptions(name="one")) == first
    assert CaseFolder(folder).facts.gravity_deformed is None
    options = ImportOptions(same_patient=True, align=False)
    both = run_import(scans.file("rest_ct"), scans.file("deformed_ct"), folder, options)
    case = CaseFolder(folder)
    assert len(both["sources_sha256"]) == 2 and case.has("deformed_ct") and case.facts.name == "one"
    assert case.facts.gravity_deformed is not None
    with pytest.raises(InputError, match="is the case of other scans"):
        import_alone(scans.file("rest_ct"), folder)


def test_on_the_command_line(scans: CaseFolder, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    labels, folder = str(scans.file("rest.nii.gz")), str(tmp_path / "case")
    assert cli.main(["import", labels, "-o", folder, "--json"]) == 0
    assert json.loads(capfd.readouterr().out)["residual_mm"] is None
    assert cli.main(["import", labels, "-o", folder, "--same-patient"]) == 2
    assert "--same-patient needs DEFORMED" in capfd.readouterr().err
    assert cli.main(["import", str(tmp_path / "nowhere"), "-o", str(tmp_path / "other")]) == 3
    assert "nowhere is not there" in capfd.readouterr().err
    assert not (tmp_path / "other").exists()
    assert cli.main(["analyze", labels, "-o", folder]) == 2
    capfd.readouterr()
