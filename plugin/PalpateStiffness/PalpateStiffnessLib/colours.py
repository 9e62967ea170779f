"""The colours of stiffness: viridis, even in lightness, so that it reads in grey and to the colour-blind."""

from __future__ import annotations

from typing import Any

# Viridis at ninths, red, green, blue from 0 to 1.
_ANCHORS = (
    (0.267, 0.005, 0.329), (0.283, 0.141, 0.458), (0.254, 0.265, 0.530), (0.207, 0.372, 0.553), (0.164, 0.471, 0.558),
    (0.128, 0.567, 0.551), (0.135, 0.659, 0.518), (0.267, 0.749, 0.441), (0.478, 0.821, 0.318), (0.741, 0.873, 0.150),
    (0.993, 0.906, 0.144),
)  # fmt: skip
COUNT = 256


def stiffness_colour(fraction: float) -> tuple[float, float, float]:
    """The colour at a fraction (0 to 1) of the range."""
    place = min(max(fraction, 0.0), 1.0) * (len(_ANCHORS) - 1)
    low = min(int(place), len(_ANCHORS) - 2)
    share = place - low
    red, green, blue = ((1 - share) * a + share * b for a, b in zip(_ANCHORS[low], _ANCHORS[low + 1], strict=True))
    return red, green, blue


def add_stiffness_colours(scene: Any, name: str) -> Any:
    """A colour table node with the stiffness colours."""
    node = scene.AddNewNodeByClass("vtkMRMLColorTableNode", name)
    node.SetTypeToUser()
    node.SetNumberOfColors(COUNT)
    for index in range(COUNT):
        node.SetColor(index, f"{100.0 * index / (COUNT - 1):.0f} %", *stiffness_colour(index / (COUNT - 1)), 1.0)
    return node
