"""Written CT series: valid, complete, and read back as they were."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pydicom
import pytest

from palpate.core.errors import InputError
from palpate.imaging.dicom.series import read_series
from palpate.imaging.dicom.write import SeriesIdentity, write_ct_series
from palpate.imaging.volume import Volume

IDENTITY = SeriesIdentity(
    patient_id="RESEARCH-1",
    patient_name="Made^Up",
    study="study",
    series="series",
    frame_of_reference="frame",
    number=1,
    study_description="Palpate test",
    series_description="CT pelvis, simulated",
    derivation="A test",
)


def _volume(flips: tuple[int, int, int] = (1, 1, 1), size: tuple[int, int, int] = (41, 35, 6)) -> Volume:
    """An asymmetric volume; a flip reverses the direction in which an index grows."""
    rng = np.random.default_rng(5)
    array = (rng.normal(0, 12, size) + 40 * np.arange(size[2])).astype(np.int16)
    array[3:9, 2:5, 1:3] = 900
    array[0, 0] = -1024
    affine = np.diag([1.25 * flips[0], 0.9 * flips[1], 2.0 * flips[2], 1.0])
    affine[:3, 3] = [-12.3456, 7.5, -148.25]
    return Volume(array, affine)


def _at(volume: Volume, points: np.ndarray) -> np.ndarray:
    return volume.array[tuple(np.rint(volume.to_index(points)).astype(int).T)]


@pytest.mark.parametrize("compress", [True, False])
@pytest.mark.parametrize("flips", [(1, 1, 1), (-1, 1, 1), (1, -1, -1), (-1, -1, -1)])
def test_every_voxel_comes_back_where_it_was(tmp_path: Path, compress: bool, flips: tuple[int, int, int]) -> None:
    volume = _volume(flips)
    paths = write_ct_series(tmp_path / "ct", volume, IDENTITY, compress)
    assert pydicom.dcmread(paths[0]).file_meta.TransferSyntaxUID.is_compressed == compress
    back, facts = read_series(tmp_path / "ct")
    points = volume.to_lps(np.argwhere(np.ones(volume.array.shape)).astype(float))
    assert np.array_equal(_at(back, points), volume.array.ravel())
    assert np.abs(back.to_lps(back.to_index(points[:5])) - points[:5]).max() < 1e-6
    assert len(paths) == len(facts.files) == 6
    assert facts.patient_position == "HFS"
    assert facts.notes == ()


def test_a_picture_too_small_to_compress_is_written_all_the_same(tmp_path: Path) -> None:
    volume = _volume(size=(12, 9, 4))
    write_ct_series(tmp_path / "ct", volume, IDENTITY)
    assert np.array_equal(read_series(tmp_path / "ct")[0].array, volume.array)


def test_an_oblique_grid_keeps_its_place(tmp_path: Path) -> None:
    volume = _volume()
    turn = np.eye(4)
    c, s = np.cos(0.1), np.sin(0.1)
    turn[:2, :2] = [[c, -s], [s, c]]
    turned = volume.moved(turn)
    write_ct_series(tmp_path / "ct", turned, IDENTITY)
    back, _ = read_series(tmp_path / "ct")
    assert back.affine == pytest.approx(turned.affine, abs=1e-5)


def test_values_beyond_twelve_bits_are_cut(tmp_path: Path) -> None:
    volume = _volume()
    values = volume.array.astype(np.float32)
    values[4, 4, 4], values[5, 5, 5], values[6, 6, 3] = -3000.0, 9000.0, 12.4
    write_ct_series(tmp_path / "ct", volume.with_array(values), IDENTITY)
    back, _ = read_series(tmp_path / "ct")
    assert (back.array[4, 4, 4], back.array[5, 5, 5], back.array[6, 6, 3]) == (-1024, 3071, 12)


def test_uids_are_the_same_for_the_same_words_and_unique_within_a_pair(tmp_path: Path) -> None:
    other = replace(IDENTITY, study="second", series="second", frame_of_reference="second")
    headers = [
        [pydicom.dcmread(p) for p in write_ct_series(tmp_path / name, _volume(), identity)]
        for name, identity in (("a", IDENTITY), ("b", IDENTITY), ("c", other))
    ]
    uids = [[h.SOPInstanceUID for h in series] for series in headers]
    assert uids[0] == uids[1]
    assert len({*uids[0], *uids[2]}) == 12
    for keyword in ("SeriesInstanceUID", "StudyInstanceUID", "FrameOfReferenceUID"):
        assert headers[0][0][keyword].value == headers[1][0][keyword].value != headers[2][0][keyword].value
    assert headers[0][0].PatientID == headers[2][0].PatientID


@pytest.mark.parametrize(
    ("change", "message"),
    [("shear", "not right-angled"), ("thin", "at least 3 voxels")],
)
def test_a_grid_that_is_no_series_is_refused(tmp_path: Path, change: str, message: str) -> None:
    volume = _volume()
    if change == "shear":
        affine = volume.affine.copy()
        affine[0, 2] = 0.5
        volume = Volume(volume.array, affine)
    else:
        volume = volume.with_array(volume.array[:, :, :2])
    with pytest.raises(InputError, match=message):
        write_ct_series(tmp_path / "ct", volume, IDENTITY)
    assert not (tmp_path / "ct").exists()


def test_dciodvfy_finds_nothing(tmp_path: Path) -> None:
    if shutil.which("dciodvfy") is None:
        pytest.skip("dciodvfy is absent: apt-get install dicom3tools")
    for path in write_ct_series(tmp_path / "ct", _volume(), IDENTITY)[:2]:
        done = subprocess.run(["dciodvfy", "-new", str(path)], capture_output=True, text=True, check=False)
        said = [line for line in (done.stdout + done.stderr).splitlines() if line.startswith(("Error", "Warning"))]
        assert said == []
