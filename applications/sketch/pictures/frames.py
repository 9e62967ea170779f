"""Pictures of a sketched figure in motion, and of its keyframes as drawn and as simulated (the paper's Figs 16 and 17)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure as Sheet
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from palpate.applications.film import write_film
from palpate.applications.sketch.outline import Outline
from palpate.applications.sketch.run_sketch import Sketch, triangles
from palpate.applications.sketch.sketch_summary import SketchRecord
from palpate.core.arrays import FloatArray
from palpate.core.files.atomic import atomic_folder

Picture = NDArray[np.uint8]

# Drawn so much larger, then averaged: smooth edges.
_FINER = 2
_INK, _GHOST, _PAPER, _WORDS = (40, 40, 48), (200, 120, 40), (255, 255, 255), (110, 110, 110)
# Quiet fills for parts whose drawn colour is too dark to see an outline on.
_FILLS = ("#9ec5e8", "#f2b880", "#a8d5a2", "#d9a9d4")


@dataclass(frozen=True, eq=False)
class View:
    """What part of the plane a picture shows: low (2,) mm and mm per pixel; pictures are `pixels` a side."""

    low: FloatArray
    edge: float
    pixels: int

    def at(self, x: FloatArray) -> list[tuple[float, float]]:
        """Pixel places of points (n, 2) mm."""
        rows = self.pixels - (x[:, 1] - self.low[1]) / self.edge
        columns = (x[:, 0] - self.low[0]) / self.edge
        return [(_FINER * float(c), _FINER * float(r)) for c, r in zip(columns, rows, strict=True)]


def film_pictures(sketch: Sketch, pixels: int = 480) -> Iterator[Picture]:
    """One picture (pixels, pixels, 3) for every picture of the motion; at keyframes the drawn line is laid over."""
    view = _view(sketch, pixels)
    drawn = {f"keyframe {k + 1}": d.outline for k, d in enumerate(sketch.drawings)}
    for u, said in zip(sketch.moving.u, sketch.moving.said, strict=True):
        yield frame(sketch, u, view, said, drawn.get(said))


def frame(sketch: Sketch, u: FloatArray, view: View, words: str = "", drawn: Outline | None = None) -> Picture:
    """The figure where nodal displacements u (n, 3) take it."""
    size = (_FINER * view.pixels,) * 2
    rim = sketch.figure.rim_at(u)
    inside = Image.new("1", size)
    for k, loop in enumerate(rim.loops):
        ImageDraw.Draw(inside).polygon(view.at(loop), fill=int(k == 0))
    fills = Image.new("RGB", size, _FILLS[0])
    pen = ImageDraw.Draw(fills)
    faces, parts = triangles(sketch.figure)
    places = view.at((sketch.figure.space.nodes + u)[:, :2])
    for face, number in zip(faces, parts, strict=True):
        if number > 1:
            pen.polygon([places[int(n)] for n in face], fill=_FILLS[(int(number) - 1) % len(_FILLS)])
    image = Image.new("RGB", size, _PAPER)
    image.paste(fills, mask=inside)
    pen = ImageDraw.Draw(image)
    for loops, colour, width in (((drawn.loops if drawn else ()), _GHOST, 3), (rim.loops, _INK, 2)):
        for loop in loops:
            pen.line(view.at(np.vstack([loop, loop[:1]])), fill=colour, width=_FINER * width, joint="curve")
    pen.text((_FINER * 12, _FINER * (view.pixels - 26)), words, fill=_WORDS, font=ImageFont.load_default(_FINER * 14))
    return np.asarray(image.resize((view.pixels,) * 2, Image.Resampling.BOX))


def keyframe_sheet(sketch: Sketch) -> Sheet:
    """Above the keyframes as drawn, below as simulated with the drawn line over them."""
    view = _view(sketch, 360)
    states = [np.zeros_like(sketch.moving.u[0]), *(e.u for e in sketch.fit.states)]
    sheet = Sheet(figsize=(2.6 * len(states), 5.4), layout="constrained")
    axes = sheet.subplots(2, len(states), squeeze=False)
    low, high = view.low, view.low + view.edge * view.pixels
    for k, (drawing, u) in enumerate(zip(sketch.drawings, states, strict=True)):
        for loop in drawing.outline.loops:
            axes[0, k].fill(
                *loop.T, facecolor="white" if loop is not drawing.outline.loops[0] else "0.85", edgecolor="black"
            )
        axes[0, k].set_xlim(low[0], high[0])
        axes[0, k].set_ylim(low[1], high[1])
        axes[0, k].set_aspect("equal")
        axes[0, k].set_title(f"keyframe {k + 1}, drawn", fontsize=8)
        axes[1, k].imshow(frame(sketch, u, view, "", drawing.outline))
        missed = "" if k == 0 else f", {sketch.summary['keyframes'][k - 1]['hausdorff_percent']:.1f} % off at most"
        axes[1, k].set_title(f"simulated{missed}", fontsize=8)
    for one in axes.ravel():
        one.set_xticks([])
        one.set_yticks([])
    return sheet


def _view(sketch: Sketch, pixels: int) -> View:
    every = np.vstack(
        [sketch.figure.rim_at(u).points for u in sketch.moving.u] + [d.outline.points for d in sketch.drawings]
    )
    low, high = every.min(axis=0), every.max(axis=0)
    side = 1.12 * float((high - low).max())
    return View(0.5 * (low + high) - 0.5 * side, side / pixels, pixels)


def write_sketch(sketch: Sketch, folder: Path, per_second: float = 25.0) -> SketchRecord:
    """Writes film.mp4, pictures/0001.png ..., keyframes.png and sketch.json, whole or not at all; returns what sketch.json says."""
    pictures = list(film_pictures(sketch))
    with atomic_folder(folder) as made:
        (made / "pictures").mkdir()
        for k, picture in enumerate(pictures, start=1):
            Image.fromarray(picture).save(made / "pictures" / f"{k:04d}.png")
        codec = write_film(made / "film.mp4", pictures, per_second)
        keyframe_sheet(sketch).savefig(made / "keyframes.png", dpi=110)
        summary: SketchRecord = {**sketch.summary, "film": {"codec": codec, "per_second": per_second}}
        (made / "sketch.json").write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return summary
