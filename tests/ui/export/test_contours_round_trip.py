"""Contours out and in again, through every form: Dice at least 0.98, position within half a voxel. ``pytest -s`` prints
the table.
"""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk
from dicom_cases import FLIPS, TURN, pair, who
from drawn_contours import user_labels
from phantoms import affine
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonMath import vtkMatrix4x4

from palpate.case.aligned_labels import NOTE, UNSURE, in_own_frame
from palpate.case.case_folder import CaseFolder
from palpate.case.labels_on_scan import labels_on_scan
from palpate.case.second_contours import second_contours
from palpate.case.steps.returned_labels import compared
from palpate.core.errors import InputError
from palpate.imaging.contours.itksnap_workspace import read_workspace
from palpate.imaging.contours.nifti_labels import write_labels
from palpate.imaging.contours.user_labels import UserLabels, read_user_labels
from palpate.imaging.dicom.write import write_ct_series
from palpate.imaging.grid import in_lps_order, labels_on, labels_resampled
from palpate.imaging.labels import LABELS, ORGAN_LABELS, RECTUM, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.ui.cli import main as cli
from palpate.ui.dicom.codes import TG263
from palpate.ui.export import exporter
from palpate.ui.report.quality import quality
from palpate.ui.report.record import read_record
from palpate.ui.report.report_step import exported_volumes

# Form -> file at rest, file of the deformed scan (in its own frame), whether surrounding tissue is in it.
FORMS = {
    "dicom-seg": ("rest_seg.dcm", "deformed_seg.dcm"),
    "rtstruct": ("rest_rtstruct.dcm", "deformed_rtstruct.dcm"),
    "itksnap": ("rest.itksnap", None),
    "nrrd": ("rest_labels.seg.nrrd", None),
}


def read_back(case: CaseFolder, path: Path, state: str = "rest") -> UserLabels:
    return read_user_labels(path, *case.series(state))


def dice(found: Volume, wanted: Volume, value: int) -> float:
    one, other = labels_on(found, wanted).array == value, wanted.array == value
    return 2.0 * float((one & other).sum()) / float(one.sum() + other.sum())


def middle(volume: Volume, value: int) -> np.ndarray:
    return volume.to_lps(np.argwhere(volume.array == value).astype(float)).mean(axis=0)


def assert_same(found: Volume, wanted: Volume, least: float = 0.98, name: str = "") -> None:
    values = [v for v in LABELS if v not in (0, SURROUNDING_TISSUE) and (wanted.array == v).any()]
    overlaps = {LABELS[v]: dice(found, wanted, v) for v in values}
    shifts = {LABELS[v]: np.abs(middle(found, v) - middle(wanted, v)).max() for v in values}
    print(f"{name:40s} Dice {min(overlaps.values()):.4f}  shift {max(shifts.values()):.3f} mm")
    assert min(overlaps.values()) >= least, overlaps
    assert max(shifts.values()) <= 0.5 * wanted.spacing.min(), shifts


@pytest.mark.parametrize("flips", FLIPS)
def test_every_form_in_all_eight_flips(flips: tuple[int, int, int], tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine(flips=flips), deformed=False)
    for form, (name, _) in FORMS.items():
        exporter(form).export(case, tmp_path / form)
        found = read_back(case, tmp_path / form / name)
        assert found.prostate_is_split
        assert_same(found.volume, case.labels("rest"), 1.0, f"{form} {flips}")


@pytest.fixture(scope="module")
def fine(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    """Labels on a grid of their own, finer than the CT and turned against it, as segmentation writes them."""
    case = pair(tmp_path_factory.mktemp("fine") / "case", affine(rotation_deg=6.0, flips=(-1, 1, -1)))
    for state in ("rest", "deformed"):
        labels = case.labels(state)
        counts = np.array([100, 100, 100])
        grid = np.diag([1.0, 1.0, 1.0, 1.0])
        grid[:3, 3] = labels.to_lps((np.array(labels.array.shape) - 1.0)[None] / 2.0)[0] - (counts - 1) / 2.0
        case.write_labels(state, labels_on(labels, Volume(np.zeros(counts, dtype=np.uint8), grid)))
    return case


@pytest.mark.parametrize("form", FORMS)
def test_labels_finer_than_the_scan(form: str, fine: CaseFolder, tmp_path: Path) -> None:
    """Of what lies on the scan's slices only: an RTSTRUCT has contours on slices, a workspace a segmentation on the
    scan's grid.
    """
    exporter(form).export(fine, tmp_path)
    ct = fine.ct("rest")
    wanted = labels_resampled(fine.labels("rest"), ct)
    found = read_back(fine, tmp_path / FORMS[form][0]).volume
    assert_same(found, wanted, name=form)
    if form != "rtstruct":
        np.testing.assert_allclose(in_lps_order(found).affine, ct.affine, atol=1e-5)
        assert found.array.shape == ct.array.shape or form == "dicom-seg"
    assert_same(read_back(fine, tmp_path / FORMS[form][0]).volume, fine.labels("rest"), 0.93, f"{form}, fine grid")


@pytest.mark.parametrize("form", ["dicom-seg", "rtstruct"])
def test_the_deformed_scan_has_its_contours_in_its_own_frame(form: str, fine: CaseFolder, tmp_path: Path) -> None:
    exporter(form).export(fine, tmp_path)
    wanted = fine.labels("deformed").moved(np.linalg.inv(TURN))
    volume, facts = fine.series("deformed")
    found = read_user_labels(tmp_path / FORMS[form][1], volume, facts)
    assert_same(found.volume, labels_resampled(wanted, volume), name=form)
    with pytest.raises(InputError, match="was drawn on another scan"):
        read_back(fine, tmp_path / FORMS[form][1])


@pytest.mark.parametrize("state", ["rest", "deformed"])
@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("dicom-seg", "{}_seg.dcm"), ("rtstruct", "{}_rtstruct.dcm"), ("itksnap", "{}.itksnap"),
        ("itksnap", "{}_labels.nii.gz"), ("nrrd", "{}_labels.seg.nrrd"),
    ],
)  # fmt: skip
def test_labels_that_come_back_unchanged_differ_in_no_voxel(
    form: str, name: str, state: str, fine: CaseFolder, tmp_path: Path
) -> None:
    exporter(form).export(fine, tmp_path)
    found, ct = fine.labels(state), fine.ct(state)
    given = second_contours(fine, state, tmp_path / name.format(state))
    back = compared(found, given, ct)
    assert back.changed == () and {"prostate", "bladder", "rectum"} <= set(back.kept)
    assert np.array_equal(back.labels.array, found.array)
    one = tuple(np.argwhere(given.array == RECTUM)[7])
    array = given.array.copy()
    array[one] = 0
    assert compared(found, given.with_array(array), ct).changed == ("rectum",)


def test_the_report_has_the_volumes_that_exports_have(fine: CaseFolder, tmp_path: Path) -> None:
    exporter("dicom-seg").export(fine, tmp_path)
    told = exported_volumes(fine)
    for state in ("rest", "deformed"):
        found = read_user_labels(tmp_path / f"{state}_seg.dcm", *fine.series(state)).volume
        cc = float(np.prod(found.spacing)) / 1000.0
        assert {1, 2, 5, 6} <= set(np.unique(found.array))
        for value in np.unique(found.array[found.array > 0]):
            assert told[state][LABELS[int(value)]] == pytest.approx((found.array == value).sum() * cc, abs=1e-3)
    text = str(quality(read_record(fine, {}), [], told).blocks)
    assert (
        f"left half of the prostate {told['rest']['prostate_left']:.1f} and {told['deformed']['prostate_left']:.1f} cc"
        in text
    )


def test_seg_and_rtstruct_share_names(fine: CaseFolder, tmp_path: Path) -> None:
    for form in ("dicom-seg", "rtstruct"):
        exporter(form).export(fine, tmp_path)
    segments = {s.SegmentLabel for s in pydicom.dcmread(tmp_path / "rest_seg.dcm").SegmentSequence}
    structures = {s.ROIName for s in pydicom.dcmread(tmp_path / "rest_rtstruct.dcm").StructureSetROISequence}
    assert segments == structures - {"Prostate"} and "Prostate_L" in segments


def test_simpleitk_and_pydicom_agree_on_place(fine: CaseFolder, tmp_path: Path) -> None:
    exporter("nrrd").export(fine, tmp_path)
    other = Volume.from_sitk(sitk.ReadImage(str(tmp_path / "rest_labels.seg.nrrd")))
    assert_same(other, labels_resampled(fine.labels("rest"), fine.ct("rest")), 1.0)
    exporter("rtstruct").export(fine, tmp_path)
    structures = pydicom.dcmread(tmp_path / "rest_rtstruct.dcm")
    rois = {r.ROINumber: r.ROIName for r in structures.StructureSetROISequence}
    for roi in structures.ROIContourSequence:
        points = np.concatenate([np.array(c.ContourData, dtype=float).reshape(-1, 3) for c in roi.ContourSequence])
        name = rois[roi.ReferencedROINumber]
        values = ORGAN_LABELS if name == "Prostate" else [v for v, of in TG263.items() if of == name]
        drawn = fine.labels("rest")
        inside = drawn.to_lps(np.argwhere(np.isin(drawn.array, values)).astype(float))
        np.testing.assert_allclose(points.min(axis=0), inside.min(axis=0), atol=3.0)
        np.testing.assert_allclose(points.max(axis=0), inside.max(axis=0), atol=3.0)


def test_a_workspace_that_was_moved_finds_its_images(fine: CaseFolder, tmp_path: Path) -> None:
    exporter("itksnap").export(fine, tmp_path / "here")
    shutil.move(tmp_path / "here", tmp_path / "there")
    workspace = read_workspace(tmp_path / "there" / "rest.itksnap")
    assert {layer.path.name for layer in workspace.layers} == {
        "rest_ct.nii.gz", "rest_labels.nii.gz", "deformed_ct.nii.gz", "stiffness_kpa.nii.gz",
    }  # fmt: skip
    assert all(layer.path.is_file() for layer in workspace.layers)
    assert workspace.names == {value: name for value, name in LABELS.items() if value}
    read_back(fine, tmp_path / "there" / "rest.itksnap")


def test_slicer_reads_our_segmentation_with_names_and_place(fine: CaseFolder, tmp_path: Path) -> None:
    slicer = pytest.importorskip("slicer", reason="slicer-core is absent: pip install slicer-core")
    exporter("nrrd").export(fine, tmp_path)
    scene = slicer.vtkMRMLScene()
    storage, node = slicer.vtkMRMLSegmentationStorageNode(), slicer.vtkMRMLSegmentationNode()
    for each in (storage, node):
        scene.AddNode(each)
    storage.SetFileName(str(tmp_path / "rest_labels.seg.nrrd"))
    assert storage.ReadData(node) == 1
    names = [
        node.GetSegmentation().GetNthSegment(i).GetName() for i in range(node.GetSegmentation().GetNumberOfSegments())
    ]
    wanted = labels_on_scan(fine, "rest")
    assert names == [LABELS[int(v)] for v in np.unique(wanted.array) if v]
    for number, name in enumerate(names):
        value = next(v for v in LABELS if LABELS[v] == name)
        image = node.GetBinaryLabelmapInternalRepresentation(node.GetSegmentation().GetNthSegmentID(number))
        stored = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions(), order="F")
        index = np.argwhere(stored == value) + np.array(image.GetExtent())[::2]
        matrix = vtkMatrix4x4()
        image.GetImageToWorldMatrix(matrix)
        ras = np.array([[matrix.GetElement(r, c) for c in range(4)] for r in range(4)])
        shown = (index @ ras[:3, :3].T + ras[:3, 3]) * [-1, -1, 1]
        drawn = wanted.to_lps(np.argwhere(wanted.array == value).astype(float))
        np.testing.assert_allclose(np.sort(shown, axis=0), np.sort(drawn, axis=0), atol=1e-3)
    # And what Slicer writes is read here: the same labels.
    storage.SetFileName(str(tmp_path / "by_slicer.seg.nrrd"))
    assert storage.WriteData(node) == 1
    assert_same(read_back(fine, tmp_path / "by_slicer.seg.nrrd").volume, wanted, 1.0)


@pytest.mark.parametrize("form", FORMS)
def test_every_form_is_imported_by_the_command_line(form: str, fine: CaseFolder, tmp_path: Path) -> None:
    exporter(form).export(fine, tmp_path)
    drawn, case = tmp_path / FORMS[form][0], tmp_path / "case"
    command = [
        "import",
        str(fine.file("rest_ct")),
        str(fine.file("deformed_ct")),
        "-o",
        str(case),
        "--no-align",
        "--quiet",
    ]
    assert cli.main([*command, "--rest-labels", str(drawn)]) == 0
    found = user_labels(CaseFolder(case), "rest")
    assert found is not None
    assert_same(found, fine.labels("rest"), 0.93, f"{form}, imported")


def test_a_workspace_whose_labels_changed_is_imported_again(fine: CaseFolder, tmp_path: Path) -> None:
    exporter("itksnap").export(fine, tmp_path)
    command = ["import", str(fine.file("rest_ct")), str(fine.file("deformed_ct")), "-o", str(tmp_path / "case"), "--no-align",
               "--quiet", "--rest-labels", str(tmp_path / "rest.itksnap")]  # fmt: skip
    assert cli.main(command) == 0
    ct = fine.ct("rest")
    write_labels(tmp_path / "rest_labels.nii.gz", ct.with_array((ct.array > 500).astype(np.uint8)))
    assert cli.main(command) == 0
    found = user_labels(CaseFolder(tmp_path / "case"), "rest")
    assert found is not None and np.unique(found.array).tolist() == [0, 1]
    (tmp_path / "rest_labels.nii.gz").unlink()
    assert cli.main(command) == 3


@pytest.mark.parametrize(
    "form, name",
    [
        ("dicom-seg", "deformed_seg.dcm"),
        ("rtstruct", "deformed_rtstruct.dcm"),
        ("itksnap", "deformed.itksnap"),
        ("itksnap", "deformed_labels.nii.gz"),
        ("nrrd", "deformed_labels.seg.nrrd"),
    ],
)
def test_labels_of_the_deformed_scan_come_back_to_where_they_were(
    form: str, name: str, fine: CaseFolder, tmp_path: Path
) -> None:
    """DICOM has them in the scan's own frame, the others moved onto the scan at rest with the scan."""
    exporter(form).export(fine, tmp_path)
    found = second_contours(fine, "deformed", tmp_path / name)
    assert_same(found, fine.labels("deformed"), 0.93, name)


@pytest.mark.parametrize("form, name", [("itksnap", "deformed.itksnap"), ("nrrd", "deformed_labels.seg.nrrd")])
def test_an_import_tells_where_labels_of_the_deformed_scan_were_drawn(
    form: str, name: str, fine: CaseFolder, tmp_path: Path
) -> None:
    exporter(form).export(fine, tmp_path)
    ct, facts = fine.series("deformed")
    aligned = read_user_labels(tmp_path / name, ct, facts)
    own = in_own_frame(aligned, ct, fine.deformed_to_rest())
    assert NOTE in own.notes and NOTE not in aligned.notes
    assert_same(own.volume, labels_resampled(fine.labels("deformed").moved(np.linalg.inv(TURN)), ct))
    assert in_own_frame(own, ct, fine.deformed_to_rest()) is own
    assert in_own_frame(aligned, ct, np.eye(4)) is aligned


def test_resampled_labels_of_the_deformed_scan_are_taken_where_their_axes_point(
    fine: CaseFolder, tmp_path: Path
) -> None:
    exporter("itksnap").export(fine, tmp_path)
    ct, facts = fine.series("deformed")
    exported = read_user_labels(tmp_path / "deformed.itksnap", ct, facts)
    finer = exported.volume.affine @ np.diag([0.7, 0.7, 0.7, 1.0])
    resampled = replace(exported, volume=Volume(exported.volume.array, finer))
    on_rest = in_own_frame(resampled, ct, fine.deformed_to_rest())
    assert NOTE in on_rest.notes
    np.testing.assert_allclose(fine.deformed_to_rest() @ on_rest.volume.affine, finer, atol=1e-9)
    on_scan = replace(exported, volume=Volume(exported.volume.array, ct.affine @ np.diag([0.7, 0.7, 0.7, 1.0])))
    assert in_own_frame(on_scan, ct, fine.deformed_to_rest()) is on_scan
    shifted = np.eye(4)
    shifted[:3, 3] = 3.3
    assert UNSURE in in_own_frame(on_scan, ct, shifted).notes  # nothing is turned, and only the grid could tell


@pytest.mark.parametrize("form, name", [("itksnap", "deformed_labels.nii.gz"), ("nrrd", "deformed_labels.seg.nrrd")])
def test_a_scan_far_from_the_one_at_rest_takes_its_corrected_labels_back(form: str, name: str, tmp_path: Path) -> None:
    """The table stood elsewhere: in the deformed scan's own frame the exported labels lie outside that scan."""
    case = pair(tmp_path / "case", affine(flips=(1, -1, 1)))
    far = TURN.copy()
    far[:3, 3] += [0.0, 0.0, 300.0]
    ct = case.series("deformed")[0].moved(np.linalg.inv(far) @ TURN)
    shutil.rmtree(case.file("deformed_ct"))
    write_ct_series(case.file("deformed_ct"), ct, who("deformed"), compress=False)
    case.write_json("alignment.json", {"deformed_to_rest": far, "residual_mm": 0.1})
    exporter(form).export(case, tmp_path / "out")
    found = second_contours(case, "deformed", tmp_path / "out" / name)
    assert_same(found, case.labels("deformed"), 1.0, name)
    case.write_json("alignment.json", {"deformed_to_rest": TURN, "residual_mm": 0.1})
    with pytest.raises(InputError, match="lie outside the CT"):
        second_contours(case, "deformed", tmp_path / "out" / name)
