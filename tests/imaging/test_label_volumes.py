"""Label volumes are the same labels in every form of file, at the same place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk

from palpate.case.case_folder import CaseFolder
from palpate.case.steps.import_scans.pair import run_import
from palpate.core.errors import InputError
from palpate.imaging.contours.nifti_labels import write_nifti
from palpate.imaging.contours.seg_nrrd import write_seg_nrrd
from palpate.imaging.contours.structure_list import list_structures
from palpate.imaging.contours.user_labels import files_of, read_label_volume, read_user_labels
from palpate.imaging.grid import in_lps_order
from palpate.imaging.scans.scan import is_ct
from palpate.imaging.volume import Volume

FORMS = ["a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.mhd"]


def labels() -> Volume:
    """On a grid whose axes are not the patient's."""
    array = np.zeros((8, 9, 7), dtype=np.uint8)
    array[2:4, 3:6, 1:5], array[4:6, 3:6, 1:5], array[1:3, 7:, 2:6] = 1, 2, 5
    affine = np.array([[0.0, -2.0, 0.0, -7.0], [1.5, 0.0, 0.0, 4.0], [0.0, 0.0, 3.0, 11.0], [0.0, 0.0, 0.0, 1.0]])
    return Volume(array, affine)


def written(path: Path, volume: Volume) -> Path:
    if ".nii" in path.name:
        write_nifti(path, volume)
    else:
        sitk.WriteImage(volume.to_sitk(), str(path), useCompression=path.suffix != ".mhd")
    return path


def ct() -> Volume:
    return labels().with_array(np.zeros(labels().array.shape, dtype=np.int16))


@pytest.mark.parametrize("kind", [np.uint8, np.int16, np.float32])
@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_labels(form: str, kind: type, tmp_path: Path) -> None:
    path = written(tmp_path / form, labels().with_array(labels().array.astype(kind)))
    truth = in_lps_order(labels())
    for read in (read_user_labels(path, ct()), read_label_volume(path)):
        found = in_lps_order(read.volume)
        np.testing.assert_array_equal(found.array, truth.array)
        np.testing.assert_allclose(found.affine, truth.affine, atol=1e-5)
        assert read.prostate_is_split
    assert [(one.identifier, one.organ) for one in list_structures(path)] == [
        ("1", "prostate_left"), ("2", "prostate_right"), ("5", "bladder")
    ]  # fmt: skip
    assert not is_ct(path)


@pytest.mark.parametrize("form", FORMS)
def test_names_beside_it_and_the_callers_choice(form: str, tmp_path: Path) -> None:
    path = written(tmp_path / form, labels())
    chosen = read_user_labels(path, ct(), roi={"prostate": ["5"]})
    assert int((chosen.volume.array == 1).sum()) == int((labels().array == 5).sum()) and not chosen.prostate_is_split
    (tmp_path / "labels.txt").write_text(
        '1 9 9 9 1 1 1 "Harnblase"\n2 9 9 9 1 1 1 "Rektum"\n5 9 9 9 1 1 1 "Prostata"\n'
    )
    named = read_user_labels(path, ct())
    assert {v: int((named.volume.array == v).sum()) for v in (1, 5, 6)} == {1: 16, 5: 24, 6: 24}
    assert tmp_path / "labels.txt" in files_of(path) and path in files_of(path)
    assert (tmp_path / "a.raw" in files_of(path)) == (form == "a.mhd")


def test_segments_of_slicer_under_another_ending(tmp_path: Path) -> None:
    write_seg_nrrd(tmp_path / "a.seg.nrrd", labels())
    path = (tmp_path / "a.seg.nrrd").rename(tmp_path / "a.nrrd")
    (tmp_path / "labels.txt").write_text("of other files")
    found = read_user_labels(path, ct())
    assert found.source == "seg.nrrd" and found.structures["bladder"] == ["bladder"]
    assert files_of(path) == [path] and list_structures(path)[0].name == "prostate_left"


@pytest.mark.parametrize("form", FORMS)
def test_what_is_no_label_volume_is_refused(form: str, tmp_path: Path) -> None:
    for array, said in (
        (labels().array * 0.5, "holds values that are not whole numbers"),
        (labels().array * 40, "holds the value 40, which is no label"),
        (labels().array * 0, "holds no label, only 0"),
    ):
        path = written(tmp_path / form, labels().with_array(array))
        with pytest.raises(InputError, match=rf"{form} {said}") as refused:
            read_user_labels(path, ct())
        assert "\n" not in str(refused.value)


def test_colours_and_a_probability_for_each_organ_are_refused(tmp_path: Path) -> None:
    image = sitk.GetImageFromArray(np.ones((7, 9, 8, 3), dtype=np.uint8), isVector=True)
    for form in ("a.nrrd", "a.mha"):
        sitk.WriteImage(image, str(tmp_path / form))
        with pytest.raises(InputError, match=rf"{form} holds more than a number for each voxel"):
            read_user_labels(tmp_path / form, ct())


def test_centimetres_are_told(tmp_path: Path) -> None:
    path = written(tmp_path / "a.nrrd", labels())
    text = path.read_bytes()
    header, end, voxels = text.partition(b"\n\n")
    path.write_bytes(header + b'\nspace units: "cm" "cm" "cm"' + end + voxels)
    found = read_label_volume(path)
    assert found.volume.spacing == pytest.approx((15.0, 20.0, 30.0))
    assert any("units of 10 mm" in note for note in found.notes)


def test_labels_of_two_states_become_a_case(tmp_path: Path) -> None:
    rest = written(tmp_path / "rest.mha", labels())
    deformed = written(tmp_path / "deformed.nrrd", labels().with_array(np.roll(labels().array, 1, axis=1)))
    run_import(rest, deformed, tmp_path / "case")
    case = CaseFolder(tmp_path / "case")
    assert sorted(np.unique(case.labels("deformed").array)) == [0, 1, 2, 5]
    with pytest.raises(InputError, match=r"a\.stl holds no voxels with labels; give .*MetaImage.*NRRD"):
        read_label_volume(tmp_path / "a.stl")
