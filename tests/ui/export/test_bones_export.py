"""Which bone is which, for ITK-SNAP and 3D Slicer, and back as bone."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from palpate.case.case_facts import CaseFacts
from palpate.case.case_folder import CaseFolder
from palpate.imaging.contours.itksnap_labels import read_label_names
from palpate.imaging.contours.named_labels import labels_of
from palpate.imaging.contours.nifti_labels import read_nifti, write_labels
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd
from palpate.imaging.labels import BONE, BONE_PARTS
from palpate.imaging.volume import Volume
from palpate.ui.export import exporter


def _case(folder: Path) -> tuple[CaseFolder, Volume]:
    case = CaseFolder.create(folder / "case", CaseFacts("bones"))
    labels, bones = np.full((8, 9, 7), 3, dtype=np.uint8), np.zeros((8, 9, 7), dtype=np.uint8)
    labels[3:5, 4:6, 2:4] = 1
    bones[0, :3], bones[0, 4:], bones[7, :3], bones[7, 4:], bones[3:5, 8] = 1, 3, 2, 4, 5
    labels[bones > 0] = BONE
    grid = Volume(labels, np.diag([1.5, 2.0, 3.0, 1.0]))
    for state in ("rest", "deformed"):
        case.write_labels(state, grid)
    write_labels(case.file("rest_bones.nii.gz"), grid.with_array(bones))
    return case, grid.with_array(bones)


def test_bones_for_itksnap(tmp_path: Path) -> None:
    case, bones = _case(tmp_path)
    files = exporter("itksnap").export(case, tmp_path / "out")
    assert tmp_path / "out/rest_bones.nii.gz" in files
    assert tmp_path / "out/deformed_bones.nii.gz" not in files
    again = read_nifti(tmp_path / "out/rest_bones.nii.gz")
    assert np.array_equal(again.array, bones.array)
    assert np.allclose(again.affine, bones.affine)
    assert read_label_names(tmp_path / "out/bones.txt") == {0: "outside", **BONE_PARTS}


def test_bones_for_slicer(tmp_path: Path) -> None:
    case, bones = _case(tmp_path)
    exporter("nrrd").export(case, tmp_path / "out")
    segments = read_seg_nrrd(tmp_path / "out/rest_bones.seg.nrrd")
    assert set(segments.names) == set(BONE_PARTS.values()) - {"spine"}
    for value, name in BONE_PARTS.items():
        if name in segments.names:
            assert np.array_equal(segments.mask(name), bones.array == value)
    back, chosen, _ = labels_of(segments, "the file")
    assert np.array_equal(back.array == BONE, bones.array > 0)
    assert set(chosen) == {"bone"}
