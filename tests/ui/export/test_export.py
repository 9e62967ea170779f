"""What other programs get lies where it lay and holds what it held."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
import SimpleITK as sitk
from phantoms import write_case

from palpate.case.case_folder import CaseFolder
from palpate.core.mesh import TetMesh
from palpate.imaging.contours.nifti_labels import read_labels, read_nifti
from palpate.imaging.volume import Volume
from palpate.meshing.mesh_file import mesh_arrays
from palpate.ui.cli import main as cli
from palpate.ui.export import names


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    return write_case(tmp_path_factory.mktemp("export") / "case", ct=True)


def centre(volume: Volume, inside: np.ndarray) -> np.ndarray:
    return volume.to_lps(np.argwhere(inside).astype(float)).mean(axis=0)


def export(case: CaseFolder, form: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> dict[str, Path]:
    assert cli.main(["export", str(case.path), "--to", form, str(folder), "--json", "--quiet"]) == 0
    files = [Path(path) for path in json.loads(capfd.readouterr().out)["files"]]
    assert sorted(files) == sorted(folder.iterdir())
    return {path.name: path for path in files}


def test_nifti_for_itksnap(case: CaseFolder, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    files = export(case, "itksnap", tmp_path, capfd)
    labels, G, ct = case.labels("rest"), read_nifti(files["stiffness_kpa.nii.gz"]), read_nifti(files["rest_ct.nii.gz"])
    back = read_labels(files["rest_labels.nii.gz"])
    for label, value in ((1, 120.0), (2, 40.0)):
        wanted = centre(labels, labels.array == label)
        assert np.allclose(centre(back, back.array == label), wanted)
        assert np.allclose(centre(G, G.array == np.float32(value)), wanted)
    assert np.allclose(centre(ct, ct.array > 500), centre(case.ct("rest"), case.ct("rest").array > 500))


def test_nrrd(case: CaseFolder, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    files = export(case, "nrrd", tmp_path, capfd)
    labels, G = case.labels("rest"), Volume.from_sitk(sitk.ReadImage(str(files["stiffness_kpa.nrrd"])))
    assert np.allclose(centre(G, G.array == np.float32(40.0)), centre(labels, labels.array == 2))


def test_vtu(case: CaseFolder, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
    mesh = TetMesh(points, np.array([[0, 1, 2, 3], [1, 2, 3, 4]])[:, [0, 1, 2, 3]], np.array([2, 3]))
    case.write_npz("mesh.npz", **mesh_arrays(mesh, {}))
    case.write_json("mesh.json", {"cells": 2})
    grid = pv.read(export(case, "vtu", tmp_path, capfd)["mesh.vtu"])
    assert np.allclose(grid.points, points)
    assert grid.cell_data["G_kpa"].tolist() == [40.0, 20.0]


def test_an_unwritable_folder_is_3(case: CaseFolder, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("")
    assert cli.main(["export", str(case.path), "--to", "nrrd", str(tmp_path / "file" / "out"), "--quiet"]) == 3
    assert "file" in capfd.readouterr().err


def test_forms_are_found_by_their_files() -> None:
    assert names() == (
        "dicom-pdf",
        "dicom-pm",
        "dicom-reg",
        "dicom-seg",
        "dicom-series",
        "dicom-sr",
        "itksnap",
        "nrrd",
        "rtstruct",
        "transform",
        "uncertainty",
        "vtu",
    )
