"""Makes the screenshot from off-screen views of Slicer's own slice logic: ``python docs/slicer_pictures/make.py CASE``.

Needs slicer-core, VTK and matplotlib, and a case that has been identified. The module's own nodes are what is drawn.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
import slicer
import vtk
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.patheffects import withStroke
from vtkmodules.util.numpy_support import vtk_to_numpy

PLUGIN = Path(__file__).resolve().parents[2] / "plugin"
sys.path.insert(0, str(PLUGIN / "PalpateStiffness"))
from PalpateStiffnessLib.logic import StiffnessLogic  # noqa: E402
from PalpateStiffnessLib.mrml import MrmlScene  # noqa: E402
from PalpateStiffnessLib.nodes import ResultNodes  # noqa: E402

SIZE, FIELD_MM = 480, 150.0
_TICKS_KPA = (5, 10, 20, 50, 100, 200)
# Slicer's colours of its views.
VIEWS = {"Axial": "#f34a33", "3D": "#7481c9", "Coronal": "#6db04a", "Sagittal": "#edd54c"}
SIDES = {"Axial": "RL", "Coronal": "RL", "Sagittal": "AP"}


def main(case: Path) -> None:
    """Exports the case, loads it as the module does, draws."""
    found = loaded(case)
    scene, nodes = found.scene, found.nodes
    centres = centres_of(nodes)
    images = {name: slice_view(scene, nodes, name, centres[name]) for name in SIDES}
    images["3D"] = solid_view(nodes, array_of(nodes.stiffness), centres["Axial"])
    compose(images, nodes, PLUGIN / "Screenshots" / "PalpateStiffness.png")
    found.logic.clean()


@dataclass(frozen=True)
class Loaded:
    """A case's export as the module loads it. held : Slicer's logic of scene and colours; without it slices are not drawn."""

    scene: MrmlScene
    held: tuple[MrmlScene, ...]
    logic: StiffnessLogic
    nodes: ResultNodes
    folder: Path


def loaded(case: Path) -> Loaded:
    """Exports a case and loads it into a scene of its own. Ends the program where the export fails."""
    scene, application = slicer.vtkMRMLScene(), slicer.vtkMRMLApplicationLogic()
    application.SetMRMLScene(scene)
    colours = slicer.vtkMRMLColorLogic()
    colours.SetMRMLScene(scene)
    colours.AddDefaultColorNodes()
    logic = StiffnessLogic(scene)
    pipeline, folder = logic.export(case)
    if pipeline.wait() != "done":
        sys.exit(pipeline.error)
    nodes = logic.show_results(folder)
    for volume in nodes.volumes.values():
        volume.GetDisplayNode().SetAndObserveColorNodeID("vtkMRMLColorTableNodeGrey")
    return Loaded(scene, (application, colours), logic, nodes, folder)


def stiffness_colours(nodes: ResultNodes) -> ListedColormap:
    """The colour table that the module loaded."""
    table, rgba = nodes.colours, [0.0] * 4
    return ListedColormap([list(rgba) for k in range(table.GetNumberOfColors()) if table.GetColor(k, rgba)])


def range_of(nodes: ResultNodes) -> Normalize:
    """From the first to the last colour, kPa."""
    display = nodes.stiffness.GetDisplayNode()
    return Normalize(display.GetWindowLevelMin(), display.GetWindowLevelMax())


def array_of(volume: Any) -> np.ndarray:
    """The voxels of a volume node (ni, nj, nk)."""
    return array_of_image(volume.GetImageData())


def middle(volume: Any, inside: np.ndarray) -> np.ndarray:
    """Centre of voxels, RAS mm."""
    matrix = vtk.vtkMatrix4x4()
    volume.GetIJKToRASMatrix(matrix)
    return np.array(matrix.MultiplyPoint([*np.argwhere(inside).mean(axis=0), 1.0])[:3])


def centres_of(nodes: ResultNodes) -> dict[str, np.ndarray]:
    """Where each view is cut, RAS mm: through the middle of the organ; the sagittal one through the stiffer half, for both meet in the
    middle.
    """
    G = array_of(nodes.stiffness)
    organ, stiffest = middle(nodes.stiffness, G > 0), middle(nodes.stiffness, 0.99 * G.max() < G)
    return {"Axial": organ, "Coronal": organ, "Sagittal": np.array([stiffest[0], *organ[1:]])}


def slice_view(scene: Any, nodes: ResultNodes, name: str, centre: np.ndarray, opacity: float = 0.6) -> np.ndarray:
    """One of Slicer's slice views: the CT, and the stiffness over it."""
    logic = slicer.vtkMRMLSliceLogic()
    logic.SetMRMLScene(scene)
    logic.AddSliceNode(name)
    view = logic.GetSliceNode()
    view.SetOrientation(name)
    view.SetDimensions(SIZE, SIZE, 1)
    view.SetFieldOfView(FIELD_MM, FIELD_MM, 1)
    view.JumpSliceByCentering(*centre)
    layers = logic.GetSliceCompositeNode()
    layers.SetBackgroundVolumeID(nodes.volumes["rest"].GetID())
    layers.SetForegroundVolumeID(nodes.stiffness.GetID())
    layers.SetForegroundOpacity(opacity)
    logic.UpdatePipeline()
    port = logic.GetImageDataConnection()
    port.GetProducer().Update()
    return pixels_of(port.GetProducer().GetOutputDataObject(port.GetIndex()))


def solid_view(nodes: ResultNodes, G: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """The labels as smooth surfaces, the organ in the colours of its stiffness."""
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(0.72, 0.76, 0.93)
    renderer.SetBackground2(0.46, 0.47, 0.75)
    renderer.GradientBackgroundOn()
    segmentation = nodes.segmentations["rest"].GetSegmentation()
    for index in range(segmentation.GetNumberOfSegments()):
        segment = segmentation.GetNthSegment(index)
        if segment.GetName() in ("surrounding_tissue", "bone"):
            continue
        image = nodes.segmentations["rest"].GetBinaryLabelmapInternalRepresentation(segmentation.GetNthSegmentID(index))
        inside = array_of_image(image) == segment.GetLabelValue()
        found = G[inside] if inside.shape == G.shape else np.zeros(1)
        # Pale, so that no label's own colour is taken for a stiffness.
        pale = tuple(0.25 * channel + 0.62 for channel in segment.GetColor())
        colour = stiffness_colours(nodes)(range_of(nodes)(float(found.max())))[:3] if found.max() > 0 else pale
        renderer.AddActor(smooth_surface(image, segment.GetLabelValue(), colour))
    camera = renderer.GetActiveCamera()
    camera.SetFocalPoint(*(centre + [0, 0, 12]))
    camera.SetPosition(*(centre + [-160, 300, 110]))
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCameraClippingRange()
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetSize(SIZE, SIZE)
    window.AddRenderer(renderer)
    window.Render()
    grabbed = vtk.vtkWindowToImageFilter()
    grabbed.SetInput(window)
    grabbed.Update()
    return pixels_of(grabbed.GetOutput())


def array_of_image(image: Any) -> np.ndarray:
    """The voxels of an image (ni, nj, nk)."""
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(image.GetDimensions(), order="F")


def smooth_surface(image: Any, value: int, colour: tuple[float, float, float]) -> Any:
    """The surface of a label value in RAS."""
    plain, matrix, place = vtk.vtkImageData(), vtk.vtkMatrix4x4(), vtk.vtkTransform()
    plain.DeepCopy(image)
    plain.SetSpacing(1, 1, 1)
    plain.SetOrigin(0, 0, 0)
    image.GetImageToWorldMatrix(matrix)
    place.SetMatrix(matrix)
    cubes, smooth = vtk.vtkDiscreteFlyingEdges3D(), vtk.vtkWindowedSincPolyDataFilter()
    cubes.SetInputData(plain)
    cubes.SetValue(0, value)
    cubes.ComputeNormalsOff()
    cubes.ComputeGradientsOff()
    smooth.SetInputConnection(cubes.GetOutputPort())
    smooth.SetNumberOfIterations(50)
    smooth.SetPassBand(0.005)
    smooth.FeatureEdgeSmoothingOff()
    smooth.BoundarySmoothingOff()
    smooth.NormalizeCoordinatesOn()
    moved, normals = vtk.vtkTransformPolyDataFilter(), vtk.vtkPolyDataNormals()
    moved.SetInputConnection(smooth.GetOutputPort())
    moved.SetTransform(place)
    normals.SetInputConnection(moved.GetOutputPort())
    normals.SplittingOff()
    normals.ConsistencyOn()
    normals.AutoOrientNormalsOn()
    mapper, actor = vtk.vtkPolyDataMapper(), vtk.vtkActor()
    mapper.SetInputConnection(normals.GetOutputPort())
    mapper.ScalarVisibilityOff()
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*colour)
    return actor


def pixels_of(image: Any) -> np.ndarray:
    """Rows from the top, red, green, blue."""
    columns, rows, _ = image.GetDimensions()
    return vtk_to_numpy(image.GetPointData().GetScalars()).reshape(rows, columns, -1)[::-1, :, :3]


def compose(images: dict[str, np.ndarray], nodes: ResultNodes, path: Path) -> None:
    """Four views and the colour bar."""
    figure, axes = plt.subplots(2, 2, figsize=(9.6, 10.2), facecolor="#2b2b2b")
    outline = [withStroke(linewidth=3, foreground="black")]
    for axis, (name, colour) in zip(axes.flat, VIEWS.items(), strict=True):
        axis.imshow(images[name])
        axis.set_xticks([])
        axis.set_yticks([])
        for side in axis.spines.values():
            side.set_color(colour)
            side.set_linewidth(3)
        axis.text(10, 26, name, color="white", fontsize=11, weight="bold", path_effects=outline)
        for letter, x in zip(SIDES.get(name, ""), (10, SIZE - 24), strict=False):
            axis.text(x, SIZE / 2, letter, color="white", fontsize=13, path_effects=outline)
    figure.subplots_adjust(0.01, 0.10, 0.99, 0.99, 0.02, 0.02)
    bar = figure.add_axes((0.25, 0.062, 0.5, 0.016))
    between = range_of(nodes)
    kpa = np.geomspace(between.vmin, between.vmax, 257)
    bar.pcolormesh(kpa, (0, 1), stiffness_colours(nodes)(between(kpa[:-1]))[None], rasterized=True)
    bar.set(xscale="log", xticks=_TICKS_KPA, xticklabels=_TICKS_KPA, yticks=[])
    bar.minorticks_off()
    bar.tick_params(colors="white", labelsize=8)
    bar.set_xlabel("Shear modulus G, kPa.  Simulated pair.  Research use only, not for diagnosis.", color="white")
    figure.savefig(path, dpi=100, facecolor=figure.get_facecolor())


if __name__ == "__main__":
    main(Path(sys.argv[1]))
