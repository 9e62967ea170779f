"""Makes the pictures of the tutorial, one a step: ``python docs/slicer_pictures/make_steps.py CASE docs/tutorial/pictures``.

Needs what make.py needs and PySide6. Views by Slicer's own slice logic, the panel from its .ui file.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import slicer
from make import SIDES, SIZE, centres_of, loaded, slice_view
from matplotlib.patheffects import withStroke
from PalpateStiffnessLib.nodes import ResultNodes
from PalpateStiffnessLib.words import RESEARCH_USE, summary
from panel import panel_picture

from palpate.ui.pictures.colours import label_rgb

# Labels whose outlines are drawn, in the colours of the window and the exports.
_ORGANS = (1, 2, 4, 5, 6)
_HIGHEST = 7  # of the labels
_DPI = 100
_DONE = {"progressBar": "", "statusLabel": "done", "researchLabel": RESEARCH_USE}
_FOLDERS = {
    "restFolderEdit": "sample_dicom/rest",
    "deformedFolderEdit": "sample_dicom/deformed",
    "caseFolderEdit": "my_case",
}


def main(case: Path, folder: Path) -> None:
    """Exports the case, loads it as the module does, draws each step."""
    found = loaded(case)
    nodes = found.nodes
    told = {name: json.loads((case / f"{file}.json").read_text()) for name, file in _FILES.items()}
    views = _Views(found.scene, nodes, found.folder)
    for name, picture in _steps(views, told).items():
        _save(*picture, folder / f"slicer_{name}.png")
    found.logic.clean()


_FILES = {"import": "import", "segment": "segmentation", "mesh": "mesh", "identify": "result", "diagnose": "diagnosis"}


def _steps(views: _Views, told: dict[str, Any]) -> dict[str, tuple[np.ndarray, list[tuple[str, np.ndarray]]]]:
    """Panel and views of each step by its name."""
    loaded, segmented, found = (summary({k: told[k] for k in names}) for names in _SO_FAR)

    def panel(show: tuple[str, ...], lines: list[str], pressed: str, **texts: str) -> np.ndarray:
        return panel_picture(show, _DONE | texts | ({"summaryText": "\n".join(lines)} if lines else {}), pressed)

    install = panel(("advancedSection",), [], "installButton", statusLabel="")
    return {
        "install": (install, []),
        "load": (
            panel(("scansSection", "resultsSection"), loaded, "loadButton", **_FOLDERS),
            [("Axial, rest", views.scan("rest")), ("Axial, deformed", views.scan("deformed"))],
        ),
        "segment": (
            panel(("organsSection", "resultsSection"), segmented, "segmentButton"),
            [("Axial, labels at rest", views.labels("Axial")), ("Coronal, labels at rest", views.labels("Coronal"))],
        ),
        "report": (panel(("resultsSection",), found, "reportButton"), []),
        "correct": (
            panel(("resultsSection",), found, "correctButton", statusLabel="new case: my_case_corrected"),
            [("Sagittal, segments as they go back", views.labels("Sagittal"))],
        ),
    }


_SO_FAR = (("import",), ("import", "segment"), ("mesh", "identify", "diagnose"))


class _Views:
    """Slices of a loaded case through the middle of its organ."""

    def __init__(self, scene: Any, nodes: ResultNodes, folder: Path) -> None:
        self._scene, self._nodes, self._centres = scene, nodes, centres_of(nodes)
        self._map = _label_volume(scene, folder / "rest_labels.seg.nrrd")

    def scan(self, state: str, name: str = "Axial") -> np.ndarray:
        """A scan alone, (rows, columns, 3)."""
        shown = ResultNodes(volumes={"rest": self._nodes.volumes[state]}, stiffness=self._map)
        return slice_view(self._scene, shown, name, self._centres[name], opacity=0.0)

    def labels(self, name: str) -> np.ndarray:
        """The scan at rest with the outlines of its segments, (rows, columns, 3)."""
        drawn = self.scan("rest", name).copy()
        as_grey = ResultNodes(volumes={"rest": self._map}, stiffness=self._map)
        grey = slice_view(self._scene, as_grey, name, self._centres[name], opacity=0.0)
        value = np.rint(grey[..., 0].astype(float) / 255.0 * _HIGHEST).astype(int)
        for label in _ORGANS:
            inside = value == label
            inner = inside.copy()
            for axis in (0, 1):
                for shift in (-2, 2):
                    inner &= np.roll(inside, shift, axis)
            drawn[inside & ~inner] = np.rint(255 * np.array(label_rgb(label)))
        return drawn


def _label_volume(scene: Any, path: Path) -> Any:
    """The numbers of a segmentation file as a volume whose grey is the number, not mixed between voxels."""
    volume = scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "numbers")
    storage = slicer.vtkMRMLVolumeArchetypeStorageNode()
    scene.AddNode(storage)
    storage.SetFileName(str(path))
    if not storage.ReadData(volume):
        sys.exit(f"{path} cannot be read")
    volume.CreateDefaultDisplayNodes()
    display = volume.GetDisplayNode()
    display.SetAndObserveColorNodeID("vtkMRMLColorTableNodeGrey")
    display.AutoWindowLevelOff()
    display.SetWindowLevelMinMax(0.0, float(_HIGHEST))
    display.SetInterpolate(0)
    return volume


def _save(panel: np.ndarray, views: list[tuple[str, np.ndarray]], path: Path) -> None:
    """The panel at the left, views beside it."""
    high = max(panel.shape[0], SIZE if views else 0)
    wide = panel.shape[1] + len(views) * (SIZE + 8)
    figure = plt.figure(figsize=(wide / _DPI, high / _DPI), dpi=_DPI, facecolor="#2b2b2b")
    _place(figure, panel, 0, wide, high)
    for number, (name, image) in enumerate(views):
        axes = _place(figure, image, panel.shape[1] + 8 + number * (SIZE + 8), wide, high)
        edge = [withStroke(linewidth=3, foreground="black")]
        axes.text(10, 24, name, color="white", fontsize=11, weight="bold", path_effects=edge)
        for letter, x in zip(SIDES[name.partition(",")[0]], (10, SIZE - 24), strict=True):
            axes.text(x, SIZE / 2, letter, color="white", fontsize=13, path_effects=edge)
    figure.savefig(path, dpi=_DPI, facecolor=figure.get_facecolor())
    plt.close(figure)


def _place(figure: Any, image: np.ndarray, left: int, wide: int, high: int) -> Any:
    rows, columns = image.shape[:2]
    axes = figure.add_axes((left / wide, 1.0 - rows / high, columns / wide, rows / high))
    axes.imshow(image, interpolation="nearest", aspect="auto")
    axes.set_axis_off()
    return axes


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
