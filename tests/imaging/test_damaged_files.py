"""Damaged files of every kind: read, or refused in one line; never another exception."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from dicom_samples import enhanced_ct, save, series, straight, structure_set

from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import read_labels, write_labels
from palpate.imaging.contours.rtstruct import read_rtstruct
from palpate.imaging.dicom.series import read_series
from palpate.imaging.volume import Volume

ROUNDS = 120
HEADER = 1400


def _damaged(good: bytes, rng: np.random.Generator) -> bytes:
    """Cut short, or with bytes or bits of the header changed."""
    kind, data, header = rng.integers(3), bytearray(good), min(len(good), HEADER)
    if kind == 0:
        return good[: rng.integers(len(good))]
    for place in rng.integers(0, header, rng.integers(1, 8)):
        data[place] = rng.integers(256) if kind == 1 else data[place] ^ (1 << rng.integers(8))
    return bytes(data)


def _plain(folder: Path) -> tuple[Path, Callable[[], object]]:
    save(folder, series(straight()))
    return folder / "im_002.dcm", lambda: read_series(folder)


def _multi_frame(folder: Path) -> tuple[Path, Callable[[], object]]:
    save(folder, [enhanced_ct(straight())])
    return folder / "im_000.dcm", lambda: read_series(folder)


def _structures(folder: Path) -> tuple[Path, Callable[[], object]]:
    ct, facts = read_series(save(folder / "ct", series(straight())))
    ring = [np.array([[0, 0, z], [10, 0, z], [10, 12, z], [0, 14, z]], dtype=float) for z in (8.0, 11.0, 14.0)]
    structure_set({"Prostata": ring, "Retto": ring}).save_as(folder / "rs.dcm")
    return folder / "rs.dcm", lambda: read_rtstruct(folder / "rs.dcm", ct, facts)


def _labels(folder: Path) -> tuple[Path, Callable[[], object]]:
    folder.mkdir()
    array = np.zeros((8, 9, 7), dtype=np.uint8)
    array[2:5, 3:6, 1:5] = 1
    write_labels(folder / "a.nii", Volume(array, np.eye(4)))
    return folder / "a.nii", lambda: read_labels(folder / "a.nii")


@pytest.mark.parametrize("make", [_plain, _multi_frame, _structures, _labels])
def test_damage_is_read_or_refused_in_one_line(
    make: Callable[[Path], tuple[Path, Callable[[], object]]], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path, read = make(tmp_path / "data")
    good, rng, refused = path.read_bytes(), np.random.default_rng(7), 0
    for _ in range(ROUNDS):
        path.write_bytes(_damaged(good, rng))
        try:
            read()
        except InputError as error:
            refused += 1
            assert "\n" not in str(error) and str(tmp_path) in str(error)
    assert 0.2 * ROUNDS < refused < ROUNDS
    assert capfd.readouterr().err == ""
