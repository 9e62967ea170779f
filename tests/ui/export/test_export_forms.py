"""Forms for other programs that carry more than voxels: transform and field, terminology, structure names, intervals."""

from __future__ import annotations

import sys
from pathlib import Path

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
    assert [f.name for f in files] == ["rest_to_deformed.tfm", "displacement_mm.nrrd"]
    field = sitk.ReadImage(str(files[1]))
    for place in ([3.0, -4.0, 5.0], [-8.0, 2.0, -6.0]):
        index = field.TransformPhysicalPointToIndex((centre + place).tolist())
        at = np.array(field.TransformIndexToPhysicalPoint(index)) - centre
        np.testing.assert_allclose(field.GetPixel(*index), shear @ at, atol=1e-6)
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
    assert names == {"Prostate_L", "Prostate_R", "Bladder", "Rectum"}


def test_the_ends_of_the_interval_are_maps_of_their_own(case: CaseFolder, tmp_path: Path) -> None:
    files = exporter("dicom-pm").export(case, tmp_path)
    assert [f.name for f in files] == ["stiffness_pm.dcm", "stiffness_low_pm.dcm", "stiffness_high_pm.dcm"]
    for file, values in zip(files, ([40.0, 120.0], [40 / 1.2, 120 / 1.2], [40 * 1.2, 120 * 1.2]), strict=True):
        found = pydicom.dcmread(file).pixel_array
        np.testing.assert_allclose(np.unique(found[found > 0]), values, rtol=1e-5)
    assert len({pydicom.dcmread(f).SeriesInstanceUID for f in files}) == 3
