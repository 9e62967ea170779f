"""What a drawing's file shows, as pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, IntArray

# A picture is brought to about so many pixels across: finer than any line is drawn.
PIXELS = 900


@dataclass(frozen=True, eq=False)
class Picture:
    """solid (h, w) : 0 to 1, how much of each pixel belongs to the figure, row 0 on top.

    parts (h, w) : number of the colour each pixel has, 0 .. P - 1. colours : "#rrggbb" of each. pixel : its edge in the file's own
    unit; origin (2,) : the picture's lower left corner in that unit, y upwards, so that keyframes of one canvas share a frame.
    notes : what was read into it, one line each.
    """

    solid: FloatArray
    parts: IntArray
    colours: tuple[str, ...]
    pixel: float
    origin: FloatArray
    notes: tuple[str, ...] = ()


def hex_colour(rgb: FloatArray) -> str:
    """ "#rrggbb" of (3,) values from 0 to 1."""
    return "#" + "".join(f"{round(255 * float(np.clip(v, 0.0, 1.0))):02x}" for v in rgb)
