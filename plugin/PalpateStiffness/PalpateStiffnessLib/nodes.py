"""What the program exported, as MRML nodes. Files are in patient coordinates LPS, MRML is RAS: the storage nodes know."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import slicer

from .colours import StiffnessColours, load_stiffness_colours
from .mrml import MrmlNode, MrmlScene

STATES = ("rest", "deformed")
STIFFNESS, COLOURS, MESH = "stiffness_kpa.nrrd", "stiffness_kpa.ctbl", "mesh.vtu"
_CT_WINDOW, _CT_LEVEL = 400.0, 40.0


class LoadError(Exception):
    """A file of the program could not be shown."""


@dataclass
class ResultNodes:
    """The nodes of one case; by state where there are two. None and empty where the case has not got that far."""

    volumes: dict[str, MrmlNode] = field(default_factory=dict)
    segmentations: dict[str, MrmlNode] = field(default_factory=dict)
    stiffness: MrmlNode = None
    mesh: MrmlNode = None
    colours: MrmlNode = None
    legend: MrmlNode = None

    def all(self) -> list[MrmlNode]:
        """Every node there is."""
        single = [node for node in (self.legend, self.stiffness, self.mesh, self.colours) if node is not None]
        return [*self.volumes.values(), *self.segmentations.values(), *single]


def show(scene: MrmlScene, folder: Path) -> ResultNodes:
    """Loads what an export folder holds into a scene. Raises LoadError naming the file."""
    nodes = ResultNodes()
    for state in STATES:
        if (folder / f"{state}_ct.nrrd").is_file():
            nodes.volumes[state] = _volume(scene, folder / f"{state}_ct.nrrd", f"CT {state}")
            _show_as_ct(nodes.volumes[state])
        if (folder / f"{state}_labels.seg.nrrd").is_file():
            path = folder / f"{state}_labels.seg.nrrd"
            nodes.segmentations[state] = _loaded(
                scene, path, "vtkMRMLSegmentationNode", "vtkMRMLSegmentationStorageNode", f"Labels {state}"
            )
            _show_as_outlines(nodes.segmentations[state], state == STATES[0])
    if (folder / STIFFNESS).is_file():
        colours = _colours(scene, folder / COLOURS)
        nodes.colours = colours.node
        nodes.stiffness = _volume(scene, folder / STIFFNESS, "Stiffness G, kPa (research use only)")
        _show_as_stiffness(nodes.stiffness, colours)
        nodes.legend = _legend(nodes.stiffness)
    if (folder / MESH).is_file():
        nodes.mesh = _loaded(scene, folder / MESH, "vtkMRMLModelNode", "vtkMRMLModelStorageNode", "Mesh at rest")
        _show_mesh(nodes.mesh, nodes.colours)
    return nodes


def _colours(scene: MrmlScene, path: Path) -> StiffnessColours:
    found = load_stiffness_colours(scene, path, "Stiffness G, kPa") if path.is_file() else None
    if found is None:
        raise LoadError(f"{path.name} cannot be read; run the step again")
    return found


def _loaded(
    scene: MrmlScene,
    path: Path,
    node_class: str,
    storage_class: str,
    name: str,
    prepare: Callable[[MrmlNode], None] | None = None,
) -> MrmlNode:
    node = scene.AddNewNodeByClass(node_class, name)
    storage = scene.AddNewNodeByClass(storage_class)
    storage.SetFileName(str(path))
    if prepare is not None:
        prepare(storage)
    node.SetAndObserveStorageNodeID(storage.GetID())
    if not storage.ReadData(node):
        scene.RemoveNode(storage)
        scene.RemoveNode(node)
        raise LoadError(f"{path.name} cannot be read; run the step again")
    return node


def _volume(scene: MrmlScene, path: Path, name: str) -> MrmlNode:
    node = _loaded(
        scene, path, "vtkMRMLScalarVolumeNode", "vtkMRMLVolumeArchetypeStorageNode", name,
        lambda storage: storage.SetSingleFile(True),
    )  # fmt: skip
    node.CreateDefaultDisplayNodes()
    return node


def _show_as_ct(volume: MrmlNode) -> None:
    display = volume.GetDisplayNode()
    display.AutoWindowLevelOff()
    display.SetWindowLevel(_CT_WINDOW, _CT_LEVEL)


def _show_as_outlines(segmentation: MrmlNode, visible: bool) -> None:
    """Outlines on the slices, so that the scan is seen."""
    segmentation.CreateDefaultDisplayNodes()
    display = segmentation.GetDisplayNode()
    display.SetVisibility(visible)
    display.SetVisibility2DFill(False)
    display.SetVisibility2DOutline(True)


def _show_as_stiffness(volume: MrmlNode, colours: StiffnessColours) -> None:
    """Colours as everywhere in the program; what has no stiffness (0) is not drawn."""
    display = volume.GetDisplayNode()
    display.SetAndObserveColorNodeID(colours.node.GetID())
    display.AutoWindowLevelOff()
    display.SetWindowLevelMinMax(colours.low, colours.high)
    display.AutoThresholdOff()
    display.SetThreshold(1e-6, max(colours.high, volume.GetImageData().GetScalarRange()[1]))
    display.ApplyThresholdOn()
    display.SetInterpolate(False)  # between a value and nothing there is no value
    units = slicer.vtkCodedEntry()
    units.SetValueSchemeMeaning("kPa", "UCUM", "kilopascal")
    volume.SetVoxelValueUnits(units)


def _legend(volume: MrmlNode) -> MrmlNode:
    """The colour legend in the slice views: what a colour stands for, in kPa. None where Slicer is without its Colors module."""
    if not hasattr(slicer, "vtkSlicerColorLogic") or not volume.GetScene().IsNodeClassRegistered(
        "vtkMRMLColorLegendDisplayNode"
    ):
        return None
    legend = slicer.vtkSlicerColorLogic.AddDefaultColorLegendDisplayNode(volume.GetDisplayNode())
    if legend is not None:
        legend.SetTitleText("G, kPa")
        legend.SetLabelFormat("%.3g")
        legend.SetMaxNumberOfColors(256)
    return legend


def _show_mesh(model: MrmlNode, colours: MrmlNode) -> None:
    model.CreateDefaultDisplayNodes()
    display = model.GetDisplayNode()
    display.SetVisibility(False)  # a box of tetrahedra hides what is in it; a person turns it on
    display.SetEdgeVisibility(True)
    if colours is not None and model.GetMesh().GetCellData().HasArray("G_kpa"):
        display.SetActiveScalar("G_kpa", 1)  # vtkAssignAttribute::CELL_DATA
        display.SetAndObserveColorNodeID(colours.GetID())
        display.SetScalarVisibility(True)
