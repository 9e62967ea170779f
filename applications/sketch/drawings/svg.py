"""Figures in SVG files: filled shapes, their parts in different colours, or closed lines. Nothing in a file is followed or run."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import ParseError

import numpy as np
from PIL import Image, ImageDraw

from palpate.applications.extra import of_the_extra
from palpate.applications.sketch.drawings.picture import PIXELS, Picture, hex_colour
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError

with of_the_extra():
    import svgelements

_LARGEST_BYTES, _MOST_SHAPES = 10_000_000, 2000
# Drawn so much finer, then averaged: edges keep a fraction of a pixel.
_FINER = 4
_MARGIN = 0.06
# Ends of a line this near, in figure sizes, close it.
_CLOSES = 0.01
_CURVE = np.linspace(0.0, 1.0, 25)[1:]


def read_svg(path: Path) -> Picture:
    """Raises InputError naming the file when it is no SVG, empty, or a line does not close."""
    shapes = _shapes(path)
    every = np.vstack([loop for loops, _ in shapes for loop in loops])
    low, high = every.min(axis=0), every.max(axis=0)
    size = float((high - low).max())
    if not (np.isfinite(every).all() and 0.0 < size < 1e7):
        raise InputError(f"{path} holds coordinates that make no picture ({size:.3g} units across); save it again")
    low = low - _MARGIN * size
    pixel = (1.0 + 2.0 * _MARGIN) * size / PIXELS
    shape = np.ceil((high + _MARGIN * size - low) / pixel).astype(int)
    solid, parts, colours = _painted(shapes, low, pixel, (int(shape[1]), int(shape[0])))
    # SVG counts y downwards; the picture's lower left corner is below its last row.
    return Picture(solid, parts, colours, pixel, np.array([low[0], -(low[1] + pixel * shape[1])]))


def _shapes(path: Path) -> list[tuple[list[FloatArray], FloatArray]]:
    """Loops (n, 2) and colour (3,) of every painted element, in the order of painting."""
    raw = path.read_bytes()
    if len(raw) > _LARGEST_BYTES:
        raise InputError(
            f"{path} has {len(raw) / 1e6:.0f} MB; a drawing of up to {_LARGEST_BYTES / 1e6:.0f} MB is read"
        )
    if re.search(rb"<!ENTITY", raw, re.IGNORECASE):
        raise InputError(f"{path} defines entities, which no drawing needs; save it again as plain SVG")
    try:
        elements = list(svgelements.SVG.parse(str(path), reify=True).elements())
    except (ParseError, ValueError, TypeError, AttributeError, LookupError, ArithmeticError, RecursionError) as error:
        raise InputError(f"{path} is not a readable SVG drawing; save it again as plain SVG") from error
    drawn = [e for e in elements if isinstance(e, svgelements.Shape) and e.values.get("visibility") != "hidden"]
    if len(drawn) > _MOST_SHAPES:
        raise InputError(f"{path} has {len(drawn)} shapes; up to {_MOST_SHAPES} are read: draw one figure")
    found = [shape for shape in (_shape(element, path) for element in drawn) if shape is not None]
    if not any(colour.min() < 0.95 for _, colour in found):
        raise InputError(f"{path} is empty: no figure is drawn in it; draw one closed figure, dark on white")
    return found


def _shape(element: svgelements.Shape, path: Path) -> tuple[list[FloatArray], FloatArray] | None:
    fill, stroke = _colour(element.fill), _colour(element.stroke)
    if fill is None and stroke is None:
        return None
    loops = [loop for loop in (_flattened(part) for part in svgelements.Path(element).as_subpaths()) if len(loop) > 2]
    if not loops:
        return None
    if fill is None:
        size = max(float(np.ptp(loop, axis=0).max()) for loop in loops)
        for loop in loops:
            if np.linalg.norm(loop[0] - loop[-1]) > _CLOSES * size:
                raise InputError(f"{path}: the outline is open, its line does not close; close it, or fill the figure")
    colour = fill if fill is not None else stroke
    assert colour is not None
    return loops, colour


def _colour(paint: svgelements.Color | None) -> FloatArray | None:
    """(3,) 0 to 1, None where nothing is painted."""
    if paint is None or paint.value is None or paint.alpha == 0:
        return None
    return np.array([paint.red, paint.green, paint.blue]) / 255.0


def _flattened(part: svgelements.Subpath) -> FloatArray:
    points: list[tuple[float, float]] = []
    for segment in part:
        if isinstance(segment, svgelements.Move | svgelements.Line | svgelements.Close):
            if segment.end is not None:
                points.append((segment.end.x, segment.end.y))
        else:
            points += [(float(x), float(y)) for x, y in np.asarray(segment.npoint(_CURVE))]
    return np.array(points, dtype=np.float64).reshape(-1, 2)


def _painted(
    shapes: list[tuple[list[FloatArray], FloatArray]], low: FloatArray, pixel: float, shape: tuple[int, int]
) -> tuple[FloatArray, IntArray, tuple[str, ...]]:
    """Solid, parts and colours of a picture (h, w) = shape; white covers what is below it."""
    fine = _FINER * shape[0], _FINER * shape[1]
    owner = np.full(fine, -1)
    colours: list[str] = []
    for loops, rgb in shapes:
        mask = np.zeros(fine, dtype=bool)
        for loop in loops:
            image = Image.new("1", (fine[1], fine[0]))
            at = (loop - low) / pixel * _FINER - 0.5
            ImageDraw.Draw(image).polygon([(float(x), float(y)) for x, y in at], fill=1)
            mask ^= np.asarray(image)
        white = rgb.min() >= 0.95
        name = hex_colour(rgb)
        if not white and name not in colours:
            colours.append(name)
        owner[mask] = -1 if white else colours.index(name)
    blocks = owner.reshape(shape[0], _FINER, shape[1], _FINER)
    solid = (blocks >= 0).mean(axis=(1, 3))
    counts = np.stack([(blocks == k).sum(axis=(1, 3)) for k in range(len(colours))])
    return solid, counts.argmax(axis=0), tuple(colours)
