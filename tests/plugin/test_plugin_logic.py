"""The Slicer module's logic against the real MRML libraries (slicer-core): the program's work in the right place in a scene."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

slicer = pytest.importorskip("slicer", reason="slicer-core is absent: pip install slicer-core")
ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "plugin" / "PalpateStiffness"), str(ROOT / "tests" / "fixtures")]

from dicom_cases import TURN, pair  # noqa: E402
from PalpateStiffnessLib.errors import InputError  # noqa: E402
from PalpateStiffnessLib.logic import StiffnessLogic, seeds_of  # noqa: E402
from PalpateStiffnessLib.nodes import LoadError, ResultNodes, show  # noqa: E402
from PalpateStiffnessLib.pipeline import DONE, FAILED  # noqa: E402
from PalpateStiffnessLib.words import summary  # noqa: E402
from phantoms import MARKER, affine  # noqa: E402
from vtkmodules.util.numpy_support import vtk_to_numpy  # noqa: E402
from vtkmodules.vtkCommonMath import vtkMatrix4x4  # noqa: E402

from palpate.case.case_folder import CaseFolder  # noqa: E402
from palpate.case.labels_on_scan import labels_on_scan  # noqa: E402
from palpate.imaging.labels import LABELS  # noqa: E402
from palpate.imaging.volume import Volume  # noqa: E402
from palpate.ui.pictures.colours import STIFFNESS_SCALE  # noqa: E402

HALF_VOXEL = 0.75
RAS_TO_LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


@pytest.fixture(scope="module", autouse=True)
def program() -> Iterator[None]:
    """The program of the environment that the tests run in, not the one that `run` would make."""
    script = Path(sys.executable).with_name("palpate")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PALPATE", str(script))
        yield


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> CaseFolder:
    """An oblique scan of an asymmetric phantom, its deformed twin turned against it."""
    return pair(tmp_path_factory.mktemp("plugin") / "case", affine(rotation_deg=5.0, flips=(-1, 1, 1)))


def exported(case: CaseFolder, logic: StiffnessLogic) -> ResultNodes:
    pipeline, folder = logic.export(case.path)
    assert pipeline.wait(120) == DONE, pipeline.error
    return logic.show_results(folder)


def matrix(node: Any, method: str) -> np.ndarray:
    found = vtkMatrix4x4()
    getattr(node, method)(found)
    return RAS_TO_LPS @ np.array([[found.GetElement(r, c) for c in range(4)] for r in range(4)])


def volume_of(node: Any) -> Volume:
    image = node.GetImageData()
    array = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions(), order="F")
    return Volume(array, matrix(node, "GetIJKToRASMatrix"))


def middle(volume: Volume, inside: np.ndarray) -> np.ndarray:
    return volume.to_lps(np.argwhere(inside).astype(float)).mean(axis=0)


def segment(node: Any, value: int) -> np.ndarray:
    """Where the centre of a segment is, LPS."""
    segmentation = node.GetSegmentation()
    image = node.GetBinaryLabelmapInternalRepresentation(segmentation.GetSegmentIdBySegmentName(LABELS[value]))
    stored = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions(), order="F")
    index = np.argwhere(stored == value) + np.array(image.GetExtent())[::2]
    placed = matrix(image, "GetImageToWorldMatrix")
    return (index @ placed[:3, :3].T + placed[:3, 3]).mean(axis=0)


def assert_in_place(nodes: ResultNodes, case: CaseFolder) -> None:
    """Every node where the case has it; the marker of the CT where it was drawn."""
    ct = volume_of(nodes.volumes["rest"])
    np.testing.assert_allclose(middle(ct, ct.array > 500), MARKER, atol=HALF_VOXEL)
    for state in ("rest", "deformed"):
        wanted = labels_on_scan(case, state)
        for value in (int(v) for v in np.unique(wanted.array) if v):
            found = segment(nodes.segmentations[state], value)
            np.testing.assert_allclose(found, middle(wanted, wanted.array == value), atol=HALF_VOXEL, err_msg=state)
    labels, G = labels_on_scan(case, "rest"), volume_of(nodes.stiffness)
    for value, kpa in ((1, 120.0), (2, 40.0)):
        np.testing.assert_allclose(
            middle(G, np.float32(kpa) == G.array), middle(labels, labels.array == value), atol=HALF_VOXEL
        )


def test_nodes_lie_where_the_case_has_them(case: CaseFolder) -> None:
    scene = slicer.vtkMRMLScene()  # held here: nodes do not keep their scene alive
    nodes = exported(case, StiffnessLogic(scene))
    assert_in_place(nodes, case)
    assert nodes.stiffness.GetVoxelValueUnits().GetCodeValue() == "kPa"
    display = nodes.stiffness.GetDisplayNode()
    assert display.GetColorNode() is nodes.colours and display.GetApplyThreshold()


def test_a_colour_in_slicer_is_the_stiffness_that_it_is_in_the_report(case: CaseFolder) -> None:
    scene = slicer.vtkMRMLScene()
    nodes, scale = exported(case, StiffnessLogic(scene)), STIFFNESS_SCALE
    display, table = nodes.stiffness.GetDisplayNode(), nodes.colours.GetLookupTable()
    assert (display.GetWindowLevelMin(), display.GetWindowLevelMax()) == (scale.low, scale.high)
    count = nodes.colours.GetNumberOfColors()
    for kpa in (10.0, 40.0, 120.0):
        index = round((kpa - scale.low) / (scale.high - scale.low) * (count - 1))
        assert nodes.colours.GetColorName(index).endswith("kPa")
        np.testing.assert_allclose(table.GetTableValue(index)[:3], scale.rgb(kpa), atol=0.01)


def test_a_legend_says_what_a_colour_stands_for(case: CaseFolder) -> None:
    scene = slicer.vtkMRMLScene()
    scene.RegisterNodeClass(slicer.vtkMRMLColorLegendDisplayNode())  # Slicer's application does that
    nodes = exported(case, StiffnessLogic(scene))
    legend = slicer.vtkSlicerColorLogic.GetColorLegendDisplayNode(nodes.stiffness)
    assert legend is nodes.legend and legend.GetTitleText() == "G, kPa" and legend.GetVisibility()
    assert nodes.legend in nodes.all(), "it goes with the results"


def test_segmentations_load_as_outlines_that_hide_nothing(case: CaseFolder) -> None:
    scene = slicer.vtkMRMLScene()
    nodes = exported(case, StiffnessLogic(scene))
    for state, node in nodes.segmentations.items():
        display, segments = node.GetDisplayNode(), node.GetSegmentation()
        assert bool(display.GetVisibility()) == (state == "rest"), "the deformed one belongs to the deformed scan"
        assert display.GetVisibility2DOutline() and not display.GetVisibility2DFill()
        assert all(display.GetSegmentVisibility(name) for name in segments.GetSegmentIDs())
        assert "surrounding_tissue" not in {segments.GetSegment(name).GetName() for name in segments.GetSegmentIDs()}


def test_the_scene_is_saved_and_loaded_again(case: CaseFolder, tmp_path: Path) -> None:
    scene = slicer.vtkMRMLScene()
    logic = StiffnessLogic(scene)
    exported(case, logic)
    bundle = tmp_path / "bundle"
    bundle.mkdir()
    assert scene.SaveSceneToSlicerDataBundleDirectory(str(bundle))
    logic.clean()  # what was exported is gone; the scene keeps its own
    again = slicer.vtkMRMLScene()
    again.SetURL(str(next(bundle.glob("*.mrml"))))
    assert again.Connect()
    by_name = {name: again.GetFirstNodeByName(name) for name in (
        "CT rest", "CT deformed", "Labels rest", "Labels deformed", "Stiffness G, kPa (research use only)",
    )}  # fmt: skip
    assert all(node is not None for node in by_name.values()), by_name
    nodes = ResultNodes(
        {"rest": by_name["CT rest"], "deformed": by_name["CT deformed"]},
        {"rest": by_name["Labels rest"], "deformed": by_name["Labels deformed"]},
        by_name["Stiffness G, kPa (research use only)"],
    )
    assert_in_place(nodes, case)


def test_load_a_pair_segment_and_run(case: CaseFolder, tmp_path: Path) -> None:
    """The whole way on a phantom, from two DICOM folders to nodes; its contours stand for the automatic ones."""
    scene, folder = slicer.vtkMRMLScene(), tmp_path / "case"
    logic = StiffnessLogic(scene)
    # The phantom has no bone to align on.
    loaded = logic.load_pair(case.file("rest_ct"), case.file("deformed_ct"), folder, aligned=True)
    assert loaded.wait(120) == DONE, loaded.error
    new = CaseFolder(folder)
    new.write_json("alignment.json", {"deformed_to_rest": TURN, "residual_mm": 0.1})
    for state in ("rest", "deformed"):
        new.write_labels(state, case.labels(state))
    segmented = logic.segment(folder)
    assert segmented.wait(120) == DONE, segmented.error
    run = logic.identify(folder, "gauss-newton")
    assert run.wait(400) == DONE, run.error
    assert run.fraction == 1.0
    text = "\n".join(summary({**segmented.results, **run.results}))
    assert "prostate left: G = " in text and "95 % interval" in text and "Misfit: " in text
    nodes = exported(new, logic)
    points = vtk_to_numpy(nodes.mesh.GetMesh().GetPoints().GetData()) * [-1, -1, 1]
    cells, labels = new.read_npz("mesh.npz"), new.labels("rest")
    np.testing.assert_allclose(points, cells["points"], atol=1e-4)
    organ = cells["points"][cells["cells"][np.isin(cells["regions"], (1, 2))]].mean(axis=1)
    np.testing.assert_allclose(organ.mean(axis=0), middle(labels, np.isin(labels.array, (1, 2))), atol=2.0)
    found = volume_of(nodes.stiffness)
    left = run.results["identify"]["parameters"]["prostate_left"]["G_kpa"]
    assert np.isclose(found.array[labels.array == 1], left).all()


def test_results_replace_the_earlier_ones(case: CaseFolder) -> None:
    scene = slicer.vtkMRMLScene()
    logic = StiffnessLogic(scene)
    first = exported(case, logic)
    pipeline, folder = logic.export(case.path)
    assert pipeline.wait(120) == DONE
    logic.show_results(folder, first)
    assert scene.GetNodesByClass("vtkMRMLSegmentationNode").GetNumberOfItems() == 2
    logic.clean()
    assert not folder.exists()


def test_clicks_become_seeds(case: CaseFolder) -> None:
    scene = slicer.vtkMRMLScene()
    points = scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode", "clicks")
    points.AddControlPoint(6.5, -11.0, -148.0, "Prostate-1")  # RAS
    points.AddControlPoint(0.0, 4.0, -120.0, "bladder")
    assert seeds_of(points) == ["prostate=-6.50,11.00,-148.00", "bladder=-0.00,-4.00,-120.00"]
    assert seeds_of(None) == []
    command = StiffnessLogic(scene).segment(case.path, points).steps[0].command
    assert command[-4:] == ["--seed", "prostate=-6.50,11.00,-148.00", "--seed", "bladder=-0.00,-4.00,-120.00"]
    points.AddControlPoint(0.0, 0.0, 0.0, "F-3")
    with pytest.raises(InputError, match="'F-3' must be named after what it lies in: prostate, bladder"):
        seeds_of(points)


def test_what_cannot_be_done_is_said(case: CaseFolder, tmp_path: Path) -> None:
    logic = StiffnessLogic(slicer.vtkMRMLScene())
    with pytest.raises(InputError, match="Choose the folder of the deformed scan"):
        logic.load_pair(case.file("rest_ct"), tmp_path / "absent", tmp_path / "case")
    with pytest.raises(InputError, match="is no case; load a pair first"):
        logic.segment(tmp_path)
    with pytest.raises(InputError, match="method 'guess' is unknown"):
        logic.identify(case.path, "guess")
    (tmp_path / "rest_ct.nrrd").write_text("no image")
    with pytest.raises(LoadError, match=r"rest_ct\.nrrd cannot be read"):
        show(logic.scene, tmp_path)
    same = logic.load_pair(case.file("rest_ct"), case.file("rest_ct"), tmp_path / "case")
    assert same.wait(120) == FAILED and "same" in same.error and "\n" not in same.error


def test_no_environment_of_slicer_reaches_the_program(monkeypatch: pytest.MonkeyPatch) -> None:
    from PalpateStiffnessLib.program import environment

    monkeypatch.setenv("PYTHONHOME", "/slicer")
    assert "PYTHONHOME" not in environment() and environment()["PATH"] == os.environ["PATH"]
