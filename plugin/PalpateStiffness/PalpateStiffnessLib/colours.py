"""The colours of stiffness: the program's own scale, which it exports as a colour table of Slicer with its range in kPa."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from .mrml import MrmlNode, MrmlScene


@dataclass(frozen=True)
class StiffnessColours:
    """node : the colour table. low, high : the kPa of its first and last colour."""

    node: MrmlNode
    low: float
    high: float


def load_stiffness_colours(scene: MrmlScene, path: Path, name: str) -> StiffnessColours | None:
    """The colour table of a file, and its range; None where the file cannot be read."""
    ends = _ends(path)
    node = scene.AddNewNodeByClass("vtkMRMLColorTableNode", name)
    storage = scene.AddNewNodeByClass("vtkMRMLColorTableStorageNode")
    storage.SetFileName(str(path))
    node.SetAndObserveStorageNodeID(storage.GetID())
    if ends is None or not storage.ReadData(node):
        scene.RemoveNode(storage)
        scene.RemoveNode(node)
        return None
    return StiffnessColours(node, *ends)


def _ends(path: Path) -> tuple[float, float] | None:
    """What the table's head says: `# low_kpa 0.0`, `# high_kpa 80.0`."""
    said = {}
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        words = line.split()
        if len(words) == 3 and words[0] == "#" and words[1] in ("low_kpa", "high_kpa"):
            try:
                said[words[1]] = float(words[2])
            except ValueError:
                return None
    return (said["low_kpa"], said["high_kpa"]) if len(said) == 2 else None
