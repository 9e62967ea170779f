"""Segmentations that other programs write: DICOM SEG of every type, .seg.nrrd in layers, names in other words."""

from __future__ import annotations

from pathlib import Path

import highdicom as hd
import numpy as np
import pydicom
import pytest
import SimpleITK as sitk
from dicom_samples import COLUMNS, ROWS, save, series, straight
from pydicom.sr.codedict import codes

from palpate.core.errors import InputError
from palpate.imaging.contours.dicom_seg import read_dicom_seg
from palpate.imaging.contours.named_labels import labels_of
from palpate.imaging.contours.seg_nrrd import read_seg_nrrd
from palpate.imaging.contours.user_labels import read_user_labels
from palpate.imaging.dicom.series import SeriesFacts, read_series
from palpate.imaging.volume import Volume


@pytest.fixture(scope="module")
def scan(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Volume, SeriesFacts]:
    folder = save(tmp_path_factory.mktemp("seg") / "ct", series(straight()))
    return folder, *read_series(folder)


def masks() -> dict[str, np.ndarray]:
    """Frame, row, column; the third frame of each is empty."""
    prostate, bladder = np.zeros((6, ROWS, COLUMNS), dtype=bool), np.zeros((6, ROWS, COLUMNS), dtype=bool)
    prostate[1:5, 4:9, 3:8] = True
    bladder[3:6, 10:20, 9:17] = True
    prostate[2] = bladder[2] = False
    return {"prostate": prostate, "bladder": bladder}


def written(folder: Path, scan: Path, kind: str, labels: tuple[str, str]) -> Path:
    sources = [pydicom.dcmread(path, stop_before_pixels=True) for path in scan.iterdir()]
    sources.sort(key=lambda d: float(d.ImagePositionPatient[2]))
    for each in sources:
        each.SliceThickness, each.AccessionNumber = "3", ""
        each.PatientSex = each.StudyID = each.StudyTime = each.ReferringPhysicianName = ""
    parts = list(masks().values())
    stored = parts[0] * 1 + parts[1] * 2 if kind != "FRACTIONAL" else np.stack([0.9 * p + 0.05 for p in parts], axis=-1)
    described = [
        hd.seg.SegmentDescription(number, label, codes.SCT.AnatomicalStructure, code, "MANUAL")
        for number, label, code in zip((1, 2), labels, (codes.SCT.Prostate, codes.SCT.Bladder), strict=True)
    ]
    found = hd.seg.Segmentation(
        sources, stored.astype(np.uint8 if kind != "FRACTIONAL" else np.float32), kind, described, hd.UID(), 7, hd.UID(), 1,
        "other", "other", "1", "1", palette_color_lut_transformation=None,
    )  # fmt: skip
    path = folder / f"{kind}.dcm"
    found.save_as(path)
    return path


@pytest.mark.parametrize("kind", ["BINARY", "FRACTIONAL", "LABELMAP"])
def test_every_type_of_dicom_segmentation(kind: str, scan: tuple, tmp_path: Path) -> None:
    folder, ct, facts = scan
    found = read_user_labels(written(tmp_path, folder, kind, ("Prostata", "Harnblase")), ct, facts)
    assert found.structures == {"prostate": ["Prostata"], "bladder": ["Harnblase"]} and not found.prostate_is_split
    for value, mask in ((1, masks()["prostate"]), (5, masks()["bladder"])):
        wanted = ct.to_lps(np.argwhere(np.transpose(mask, (2, 1, 0))).astype(float))
        drawn = found.volume.to_lps(np.argwhere(found.volume.array == value).astype(float))
        np.testing.assert_allclose(np.sort(drawn, axis=0), np.sort(wanted, axis=0), atol=1e-3)


def test_codes_speak_where_labels_do_not(scan: tuple, tmp_path: Path) -> None:
    segments = read_dicom_seg(written(tmp_path, scan[0], "BINARY", ("Segment_1", "ROI 2")))
    assert segments.names == ["Prostate", "Bladder"]


def test_refusals_of_dicom_segmentations(scan: tuple, tmp_path: Path) -> None:
    folder, ct, facts = scan
    path = written(tmp_path, folder, "BINARY", ("Prostata", "Vescica"))
    with pytest.raises(InputError, match="is no DICOM segmentation"):
        read_dicom_seg(next(folder.iterdir()))
    dataset = pydicom.dcmread(path)
    dataset.FrameOfReferenceUID = "9.9"
    for each in dataset.ReferencedSeriesSequence[0].ReferencedInstanceSequence:
        each.ReferencedSOPInstanceUID = "9.8"
    dataset.save_as(tmp_path / "foreign.dcm")
    with pytest.raises(InputError, match=r"foreign\.dcm was drawn on another scan"):
        read_user_labels(tmp_path / "foreign.dcm", ct, facts)
    dataset = pydicom.dcmread(path)
    for step, frame in enumerate(dataset.PerFrameFunctionalGroupsSequence):
        frame.PlanePositionSequence[0].ImagePositionPatient = [-11, -7, 5 + 3 * step + (1.3 if step == 2 else 0)]
    dataset.save_as(tmp_path / "uneven.dcm")
    with pytest.raises(InputError, match="frames with uneven gaps"):
        read_dicom_seg(tmp_path / "uneven.dcm")
    unknown = written(tmp_path, folder, "BINARY", ("liver", "Leber"))
    dataset = pydicom.dcmread(unknown)
    for segment in dataset.SegmentSequence:
        segment.SegmentedPropertyTypeCodeSequence[0].CodeMeaning = "Liver"
    dataset.save_as(unknown)
    with pytest.raises(InputError, match="holds no organ by name, only liver, Leber; name them with --roi"):
        read_user_labels(unknown, ct, facts)
    assert read_user_labels(unknown, ct, facts, {"prostate": ["Leber"]}).structures == {"prostate": ["Leber"]}


def nrrd(path: Path, layers: int, **facts: str) -> Path:
    array = np.zeros((7, 9, 8, layers), dtype=np.uint8)  # k, j, i, layer
    array[2:5, 3:6, 1:5, 0] = 4
    array[3:6, 4:9, 2:7, layers - 1][...] = np.where(array[3:6, 4:9, 2:7, layers - 1] == 0, 9, 4)
    image = sitk.GetImageFromArray(array if layers > 1 else array[..., 0], isVector=layers > 1)
    image.SetSpacing((1.5, 2.0, 3.0))
    image.SetOrigin((-7.0, 4.0, 11.0))
    image.SetDirection((0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0))
    for key, value in facts.items():
        image.SetMetaData(key, value)
    sitk.WriteImage(image, str(path))
    return path


def test_overlapping_layers_of_a_slicer_segmentation(tmp_path: Path) -> None:
    facts = {
        "Segment0_Name": "Blase", "Segment0_LabelValue": "9", "Segment0_Layer": "1",
        "Segment1_Name": "Prostata li", "Segment1_LabelValue": "4", "Segment1_Layer": "0",
    }  # fmt: skip
    path = nrrd(tmp_path / "a.seg.nrrd", 2, **facts)
    labels, chosen, _ = labels_of(read_seg_nrrd(path), str(path))
    assert chosen == {"bladder": ["Blase"], "prostate_left": ["Prostata li"]}
    # Rows of the direction matrix are patient axes: x = -7 - 2 j, y = 4 + 1.5 i, z = 11 + 3 k. The prostate is on top.
    organ = labels.to_lps(np.argwhere(labels.array == 1).astype(float))
    np.testing.assert_allclose(organ.min(axis=0), [-7 - 2 * 5, 4 + 1.5 * 1, 11 + 3 * 2])
    np.testing.assert_allclose(organ.max(axis=0), [-7 - 2 * 3, 4 + 1.5 * 4, 11 + 3 * 4])
    assert (labels.array == 5).sum() == 3 * 5 * 5 - 2 * 2 * 3


def test_refusals_of_slicer_segmentations(tmp_path: Path) -> None:
    names = {"Segment0_Name": "prostate", "Segment0_LabelValue": "4"}
    with pytest.raises(InputError, match=r"plain\.seg\.nrrd names no segments"):
        read_seg_nrrd(nrrd(tmp_path / "plain.seg.nrrd", 1))
    with pytest.raises(InputError, match="is in layer 3, there are 1"):
        read_seg_nrrd(nrrd(tmp_path / "layer.seg.nrrd", 1, Segment0_Layer="3", **names))
    path = nrrd(tmp_path / "empty.seg.nrrd", 1, Segment0_Name="prostate", Segment0_LabelValue="77")
    with pytest.raises(InputError, match="the segments of prostate are empty"):
        labels_of(read_seg_nrrd(path), str(path))
    text = nrrd(tmp_path / "nowhere.seg.nrrd", 1, **names).read_bytes()
    (tmp_path / "nowhere.seg.nrrd").write_bytes(
        text.replace(b"space: left-posterior-superior\n", b"space dimension: 3\n")
    )
    with pytest.raises(InputError, match="does not say where it lies"):
        read_seg_nrrd(tmp_path / "nowhere.seg.nrrd")
    with pytest.raises(InputError, match="is not there"):
        read_seg_nrrd(tmp_path / "absent.seg.nrrd")
