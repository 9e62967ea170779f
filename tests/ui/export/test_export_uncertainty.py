"""Limits and the smooth map as volumes: the right value on the right side, in the place of the labels."""

from __future__ import annotations

from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
from map_arrays import map_arrays
from phantoms import CENTRE, map_facts, result, write_case

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.ui.export import exporter


@pytest.fixture
def case(tmp_path: Path) -> CaseFolder:
    case = write_case(tmp_path / "case", ct=False)
    case.write_json("result.json", result(stiffness_map=map_facts()))
    case.file("identify").mkdir(exist_ok=True)
    case.write_npz("identify/stiffness_map.npz", **map_arrays(told_left=False))
    return case


def test_values_and_places(case: CaseFolder, tmp_path: Path) -> None:
    files = {path.name: nib.load(path) for path in exporter("uncertainty").export(case, tmp_path / "out")}
    labels = case.labels("rest")
    lps_to_ras = np.diag([-1.0, -1.0, 1.0, 1.0])
    for image in files.values():
        np.testing.assert_allclose(image.affine, lps_to_ras @ labels.affine, atol=1e-5)
    values = {name.split(".")[0]: np.asarray(image.dataobj) for name, image in files.items()}
    assert set(np.unique(values["stiffness_low_kpa"][labels.array == 1])) == {np.float32(100.0)}
    assert set(np.unique(values["stiffness_high_kpa"][labels.array == 2])) == {np.float32(48.0)}
    x = labels.to_lps(np.argwhere(labels.array >= 0).astype(float))[:, 0].reshape(labels.array.shape)
    organ = np.isin(labels.array, (1, 2))
    left, right = organ & (x > CENTRE[0] + 8.0), organ & (x < CENTRE[0] - 8.0)
    assert np.median(values["map_kpa"][left]) < 30.0 < 45.0 < np.median(values["map_kpa"][right])
    assert not values["map_told"][left].any() and values["map_told"][right].all()
    np.testing.assert_allclose(values["map_factor"][organ], np.exp(0.2), rtol=1e-6)
    assert all((value[~organ] == 0).all() for value in values.values())


def test_without_a_map_the_limits_alone(case: CaseFolder, tmp_path: Path) -> None:
    case.write_json("result.json", result())
    names = {path.name for path in exporter("uncertainty").export(case, tmp_path / "out")}
    assert names == {"stiffness_low_kpa.nii.gz", "stiffness_high_kpa.nii.gz"}


def test_without_a_result_it_refuses(tmp_path: Path) -> None:
    case = write_case(tmp_path / "bare", ct=False)
    case.file("result.json").unlink(missing_ok=True)
    with pytest.raises(InputError, match=r"result\.json"):
        exporter("uncertainty").export(case, tmp_path / "out")
