"""The kPa scale as a colour table of 3D Slicer."""

from __future__ import annotations

import numpy as np

from palpate.ui.pictures.colours import STIFFNESS_LABEL, StiffnessScale

# Colours of the table: so many that a step is not seen at the soft end of the logarithmic scale.
COUNT = 2048


def colour_table(scale: StiffnessScale) -> str:
    """The text of a colour file (.ctbl): a line a colour, evenly over the range that its head names, each called by its kPa."""
    values = np.linspace(scale.low, scale.high, COUNT)
    head = [f"# {STIFFNESS_LABEL}", f"# low_kpa {scale.low!r}", f"# high_kpa {scale.high!r}"]
    lines = []
    for index, value in enumerate(values):
        r, g, b = (round(255 * channel) for channel in scale.rgb(float(value)))
        lines.append(f"{index} {value:.4g}_kPa {r} {g} {b} 255")
    return "\n".join([*head, *lines, ""])
