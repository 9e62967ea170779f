"""Keyframes to try `palpate sketch` on: letters of DejaVu Sans that lean, stretch and squat on their feet.

The outlines are those of the font that comes with matplotlib; its licence (Bitstream Vera and Arev, free) allows drawings made with
it to be used and passed on.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath

from palpate.core.arrays import FloatArray
from palpate.core.files.atomic import atomic_folder

LETTERS = "PAL"
_CANVAS, _FOOT, _TALL = 400.0, 330.0, 200.0
_COLOUR = "#3b6ea5"


def write_example(folder: Path, letters: str = LETTERS) -> list[Path]:
    """Writes LETTER_1.svg, LETTER_2.svg and LETTER_3.svg of each letter into a new folder."""
    names = []
    with atomic_folder(folder) as made:
        for letter in letters:
            loops = letter_loops(letter)
            for k in range(3):
                name = f"{letter}_{k + 1}.svg"
                (made / name).write_text(svg([_posed(loop, k) for loop in loops]), encoding="utf-8")
                names.append(name)
    return [folder / name for name in names]


def letter_loops(letter: str) -> list[FloatArray]:
    """Closed loops (n, 2) of a letter that is 1 high, its foot on y = 0, x about 0; curves as many short lines."""
    path = TextPath((0, 0), letter, size=500.0, prop=FontProperties(family="DejaVu Sans", weight="bold"))
    loops = [np.asarray(loop, dtype=np.float64)[:-1] for loop in path.to_polygons(closed_only=True)]
    every = np.vstack(loops)
    low, high = every.min(axis=0), every.max(axis=0)
    middle = np.array([0.5 * (low[0] + high[0]), low[1]])
    return [_fine((loop - middle) / (high[1] - low[1])) for loop in loops]


def svg(loops: list[FloatArray], colour: str = _COLOUR) -> str:
    """One filled path on a square canvas."""
    data = " ".join("M " + " L ".join(f"{x:.2f},{y:.2f}" for x, y in loop) + " Z" for loop in loops)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{_CANVAS:g}" height="{_CANVAS:g}" viewBox="0 0 {_CANVAS:g} {_CANVAS:g}">\n'
        f'<path fill="{colour}" fill-rule="evenodd" d="{data}"/>\n</svg>\n'
    )


def _fine(loop: FloatArray, step: float = 0.02) -> FloatArray:
    parts = [
        a + np.arange(n)[:, None] / n * (b - a)
        for a, b in zip(loop, np.roll(loop, -1, axis=0), strict=True)
        for n in [max(1, int(np.ceil(np.linalg.norm(b - a) / step)))]
    ]
    return np.vstack(parts)


def _posed(loop: FloatArray, keyframe: int) -> FloatArray:
    """The loop on the canvas, as an animator would have it: upright, then leaning and tall, then squat and leaning back."""
    x, y = loop.T
    lean, stretch = ((0.0, 0.0), (0.38, 0.10), (-0.22, -0.13))[keyframe]
    wide = x * (1.0 - 0.6 * stretch * np.minimum(3.0 * y, 1.0))
    moved = np.column_stack([wide + lean * y**2, y * (1.0 + stretch) - 0.25 * abs(lean) * x * lean * y])
    return np.column_stack([0.5 * _CANVAS + _TALL * moved[:, 0], _FOOT - _TALL * moved[:, 1]])
