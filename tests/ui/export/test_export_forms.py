"""Forms for other programs that carry more than voxels: transform and field, terminology, structure names, intervals."""

from __future__ import annotations

import sys
from pathlib import Path

import nibabel as nib
import numpy as np
import pydicom
import pytest
import SimpleITK as sitk

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "fixtures"))
from dicom_cases import FLIPS, TURN, pair
from phantoms import MARKER, affine

from palpate.case.case_folder import CaseFolder
from palpate.core.errors import InputError
from palpate.core.fem.meshes import sphere_in_cube
from palpate.ui.export import exporter


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    return pair(tmp_path_factory.mktemp("forms") / "case", affine(rotation_deg=9.0, flips=(1, -1, -1)))


@pytest.mark.parametrize("flips", FLIPS)
def test_the_transform_resamples_the_deformed_scan_onto_the_one_at_rest(
    flips: tuple[int, int, int], tmp_path: Path
) -> None:
    case = pair(tmp_path / "case", affine(rotation_deg=5.0, flips=flips), deformed=False)
    (file,) = exporter("transform").export(case, tmp_path)
    read = sitk.ReadTransform(str(file))
    there = np.array(read.TransformPoint(MARKER.tolist()))
    np.testing.assert_allclose(TURN[:3, :3] @ there + TURN[:3, 3], MARKER, atol=1e-6)


def test_the_displacement_field_adds_to_the_place_at_rest(case: CaseFolder, tmp_path: Path) -> None:
    labels = case.labels("rest")
    centre = labels.to_lps((np.array([labels.array.shape]) - 1) / 2.0)[0]
    mesh = sphere_in_cube(3, 1, 2, 10.0, 25.0)
    points = mesh.points + centre
    shear = np.array([[0.0, 0.1, 0.0], [0.0, 0.0, -0.05], [0.02, 0.0, 0.0]])
    moved = CaseFolder(case.path)
    moved.write_npz("mesh.npz", points=points, cells=mesh.cells, regions=mesh.regions)
    moved.write_json("mesh.json", {})
    moved.write_npz("identify/fields.npz", mesh_displacement=mesh.points @ shear.T)
    files = exporter("transform").export(moved, tmp_path)
    assert [f.name for f in files] == ["rest_to_deformed.tfm", "displacement_mm.nrrd", "tissue_rest_to_deformed.h5"]
    field, both = sitk.ReadImage(str(files[1])), sitk.ReadTransform(str(files[2]))
    for place in ([3.0, -4.0, 5.0], [-8.0, 2.0, -6.0]):
        index = field.TransformPhysicalPointToIndex((centre + place).tolist())
        at = np.array(field.TransformIndexToPhysicalPoint(index)) - centre
        np.testing.assert_allclose(field.GetPixel(*index), shear @ at, atol=1e-6)
        there = TURN[:3, :3] @ np.array(both.TransformPoint((at + centre).tolist())) + TURN[:3, 3]
        np.testing.assert_allclose(there, at + centre + shear @ at, atol=1e-5)
    assert field.GetPixel(0, 0, 0) == (0.0, 0.0, 0.0)


def test_without_alignment_and_field_there_is_nothing_to_write(tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine(), deformed=False)
    case.remove("alignment.json")
    with pytest.raises(InputError, match=r"neither alignment\.json nor a displacement"):
        exporter("transform").export(case, tmp_path)


def test_segments_say_what_they_are_in_slicers_terminology(case: CaseFolder, tmp_path: Path) -> None:
    files = exporter("nrrd").export(case, tmp_path)
    image = sitk.ReadImage(str(next(f for f in files if f.name == "rest_labels.seg.nrrd")))
    tags = {
        image.GetMetaData(f"Segment{n}_Name"): image.GetMetaData(f"Segment{n}_Tags")
        for n in range(10)
        if image.HasMetaDataKey(f"Segment{n}_Name")
    }
    kind, side = tags["prostate_left"].split("~")[2:4]
    assert kind == "SCT^41216001^Prostate" and side == "SCT^7771000^Left"
    assert all(
        tag.startswith("TerminologyEntry:") and tag.endswith("|") and tag.count("~") == 6 for tag in tags.values()
    )


def test_structures_are_named_as_tg_263_asks(case: CaseFolder, tmp_path: Path) -> None:
    files = exporter("rtstruct").export(case, tmp_path)
    names = {roi.ROIName for roi in pydicom.dcmread(files[0]).StructureSetROISequence}
    assert names == {"Prostate", "Prostate_L", "Prostate_R", "Bladder", "Rectum"}


def test_femoral_heads_are_balls_where_the_segmentation_found_them(case: CaseFolder, tmp_path: Path) -> None:
    """In both scans: the deformed one has them where the alignment takes them, in its own frame."""
    centre, radius = MARKER + [-6.0, 4.0, -9.0], 9.0
    head = {"centre_mm": centre.tolist(), "radius_mm": radius, "seen": 0.7}
    facts = {"organs": {"prostate": {"method": "auto"}}, "femoral_heads": {"left": head}}
    moved = CaseFolder(case.path)
    moved.write_json("segmentation.json", {"states": {"rest": facts, "deformed": facts}})
    for path, back in zip(exporter("rtstruct").export(moved, tmp_path), (np.eye(4), TURN), strict=True):
        data = pydicom.dcmread(path)
        number = next(r.ROINumber for r in data.StructureSetROISequence if r.ROIName == "Femur_Head_L")
        contours = next(r for r in data.ROIContourSequence if r.ReferencedROINumber == number).ContourSequence
        points = np.concatenate([np.array(c.ContourData, dtype=float).reshape(-1, 3) for c in contours])
        far = np.linalg.norm(points @ back[:3, :3].T + back[:3, 3] - centre, axis=1)
        assert far.max() < radius + 1.5 and abs(np.median(far) - radius) < 1.0
        assert len(contours) >= 2 * radius / 3.0 - 2
    moved.remove("segmentation.json")


def test_surrounding_tissue_leaves_only_where_it_is_asked_for(case: CaseFolder, tmp_path: Path) -> None:
    seen = {}
    for tissue in (False, True):
        folder = tmp_path / str(tissue)
        for form in ("itksnap", "nrrd", "dicom-seg", "rtstruct"):
            exporter(form).export(case, folder, tissue)
        structures = pydicom.dcmread(folder / "rest_rtstruct.dcm").StructureSetROISequence
        seen[tissue] = [
            3 in np.unique(nib.load(folder / "rest_labels.nii.gz").get_fdata()),
            3 in np.unique(sitk.GetArrayFromImage(sitk.ReadImage(str(folder / "rest_labels.seg.nrrd")))),
            "zTissue" in {s.SegmentLabel for s in pydicom.dcmread(folder / "rest_seg.dcm").SegmentSequence},
            "zTissue" in {roi.ROIName for roi in structures},
        ]
    assert seen == {False: [False] * 4, True: [True] * 4}


@pytest.mark.parametrize("flips", FLIPS)
def test_the_registration_brings_the_deformed_scan_onto_the_one_at_rest(
    flips: tuple[int, int, int], tmp_path: Path
) -> None:
    case = pair(tmp_path / "case", affine(rotation_deg=5.0, flips=flips))
    (file,) = exporter("dicom-reg").export(case, tmp_path)
    data = pydicom.dcmread(file)
    frames = {
        s: pydicom.dcmread(next(case.file(f"{s}_ct").iterdir())).FrameOfReferenceUID for s in ("rest", "deformed")
    }
    assert data.FrameOfReferenceUID == frames["rest"]
    matrices = {
        item.FrameOfReferenceUID: np.reshape(
            [
                float(x)
                for x in item.MatrixRegistrationSequence[0].MatrixSequence[0].FrameOfReferenceTransformationMatrix
            ],
            (4, 4),
        )
        for item in data.RegistrationSequence
    }
    np.testing.assert_allclose(matrices[frames["rest"]], np.eye(4))
    there = np.linalg.inv(TURN) @ [*MARKER, 1.0]
    np.testing.assert_allclose((matrices[frames["deformed"]] @ there)[:3], MARKER, atol=1e-4)


def test_one_frame_of_reference_for_both_scans_is_refused(tmp_path: Path) -> None:
    case = pair(tmp_path / "case", affine())
    frame = pydicom.dcmread(next(case.file("rest_ct").iterdir())).FrameOfReferenceUID
    for path in case.file("deformed_ct").iterdir():
        dataset = pydicom.dcmread(path)
        dataset.FrameOfReferenceUID = frame
        dataset.save_as(path)
    with pytest.raises(InputError, match="both scans state one frame of reference"):
        exporter("dicom-reg").export(case, tmp_path)


def test_the_ends_of_the_interval_are_maps_of_their_own(case: CaseFolder, tmp_path: Path) -> None:
    files = exporter("dicom-pm").export(case, tmp_path)
    assert [f.name for f in files] == ["stiffness_pm.dcm", "stiffness_low_pm.dcm", "stiffness_high_pm.dcm"]
    for file, values in zip(files, ([40.0, 120.0], [40 / 1.2, 120 / 1.2], [40 * 1.2, 120 * 1.2]), strict=True):
        found = pydicom.dcmread(file).pixel_array
        np.testing.assert_allclose(np.unique(found[found > 0]), values, rtol=1e-5)
    assert len({pydicom.dcmread(f).SeriesInstanceUID for f in files}) == 3
