"""Figures in PNG pictures: filled shapes, their parts in different colours, or closed lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, UnidentifiedImageError
from scipy import ndimage
from skimage import measure

from palpate.applications.sketch.drawings.picture import PIXELS, Picture, hex_colour
from palpate.core.arrays import BoolArray, FloatArray, IntArray
from palpate.core.errors import InputError

_LARGEST = 12000
# Colours nearer to the background than this are background; nearer to each other are one.
_PALE, _SAME = 0.12, 0.2
# A colour with less than this share of the drawn area is no part of its own.
_PART = 0.03
# What is nowhere thicker than this share of its extent is a line.
_LINE = 0.06
# A line that encloses less than this share of what its own box holds is open.
_ENCLOSES = 0.08


def read_png(path: Path) -> Picture:
    """Raises InputError naming the file when it is no PNG, too large, empty, or a line that does not close."""
    rgb, pixel = _pixels(path)
    rim = np.concatenate([rgb[0], rgb[-1], rgb[:, 0], rgb[:, -1]])
    background = np.median(rim, axis=0)
    ink = np.linalg.norm(rgb - background, axis=2)
    drawn = ink > _PALE
    if drawn.sum() < 40:
        raise InputError(f"{path} is empty: no figure is drawn in it; draw one closed figure, dark on white")
    colours = _colours(rgb, drawn)
    solid, parts = _blended(rgb, background, colours)
    origin = np.zeros(2)
    thick = [k for k in range(len(colours)) if not _is_line(drawn & (parts == k), drawn)]
    if not thick:
        return Picture(_between_lines(solid, path), np.zeros(parts.shape, dtype=np.int64), ("#808080",), pixel, origin,
                       ("the drawing was taken as a closed line: the figure is what it encloses",))  # fmt: skip
    kept = np.isin(parts, thick) & drawn
    nearest = ndimage.distance_transform_edt(~kept, return_distances=False, return_indices=True)
    renamed = np.searchsorted(thick, parts[tuple(nearest)])
    return Picture(solid, renamed, tuple(hex_colour(colours[k]) for k in thick), pixel, origin)


def _pixels(path: Path) -> tuple[FloatArray, float]:
    """(h, w, 3) colours 0 to 1 over white, and the edge of a pixel in those of the file."""
    try:
        with Image.open(path, formats=["PNG"]) as image:
            if max(image.size) > _LARGEST:
                raise InputError(
                    f"{path} has {image.size[0]} x {image.size[1]} pixels; up to {_LARGEST} a side are read"
                )
            rgba = image.convert("RGBA")
    except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError(f"{path} is not a readable PNG picture; save it again") from error
    white = Image.new("RGBA", rgba.size, (255, 255, 255, 255))
    flat = Image.alpha_composite(white, rgba).convert("RGB")
    factor = PIXELS / max(flat.size)
    shape = tuple(max(1, round(factor * n)) for n in flat.size)
    flat = flat.resize(shape, Image.Resampling.BICUBIC if factor > 1.0 else Image.Resampling.BOX)  # type: ignore[arg-type]
    return np.asarray(flat, dtype=np.float64) / 255.0, rgba.size[0] / shape[0]


def _colours(rgb: FloatArray, drawn: BoolArray) -> FloatArray:
    """(P, 3) the colours that make up the drawing, the commonest first. Blends at edges are none."""
    inner = ndimage.binary_erosion(drawn, iterations=1)
    values = rgb[inner if inner.sum() > 20 else drawn]
    bins, counts = np.unique(np.round(values * 12.0).astype(int), axis=0, return_counts=True)
    found: list[FloatArray] = []
    for k in np.argsort(-counts):
        colour = values[(np.round(values * 12.0).astype(int) == bins[k]).all(axis=1)].mean(axis=0)
        large = counts[k] >= _PART * len(values) or not found
        if large and all(np.linalg.norm(colour - other) > _SAME for other in found):
            found.append(colour)
    return np.array(found)


def _blended(rgb: FloatArray, background: FloatArray, colours: FloatArray) -> tuple[FloatArray, IntArray]:
    """How much figure each pixel holds, and which colour.

    A pixel at the figure's edge is background and the nearest pure colour; away from the background it is colours alone.
    """
    away = np.linalg.norm(rgb[:, :, None] - colours, axis=3)
    pure = away.min(axis=2) < 0.5 * _SAME
    nearest = ndimage.distance_transform_edt(~pure, return_distances=False, return_indices=True)
    part = away.argmin(axis=2)[tuple(nearest)]
    towards = colours[part] - background
    share = ((rgb - background) * towards).sum(axis=2) / (towards**2).sum(axis=2)
    beside = ndimage.binary_dilation(np.linalg.norm(rgb - background, axis=2) < _PALE, iterations=2)
    return np.where(beside, np.clip(share, 0.0, 1.0), 1.0), part


def _is_line(mask: BoolArray, drawn: BoolArray) -> bool:
    """Whether a colour is nowhere thick, seen against the whole drawing."""
    rows, columns = np.nonzero(drawn)
    extent = max(np.ptp(rows), np.ptp(columns)) + 1
    return bool(2.0 * ndimage.distance_transform_edt(mask).max() < _LINE * extent)


def _between_lines(solid: FloatArray, path: Path) -> FloatArray:
    """What closed lines enclose, to the middle of the line; a loop within a loop is a hole."""
    ink = solid >= 0.5
    number, count = ndimage.label(ink, structure=np.ones((3, 3)))
    body = np.zeros(solid.shape)
    loops = []
    for k in range(1, count + 1):
        line = number == k
        filled = ndimage.binary_fill_holes(line)
        rows, columns = np.nonzero(line)
        box = (np.ptp(rows) + 1) * (np.ptp(columns) + 1)
        loops.append((filled.sum(), filled.sum() - line.sum() > _ENCLOSES * box, line, filled))
    loops.sort(key=lambda loop: -int(loop[0]))
    if not loops[0][1]:
        raise InputError(
            f"{path}: the outline is open, its line does not close; close it, or fill the figure (nothing thinner than "
            f"{100 * _LINE:.0f} % of the drawing is taken as filled)"
        )
    for _, closed, line, filled in loops:
        if not closed and line.sum() > 60 and not (body[line] >= 0.5).all():
            raise InputError(f"{path}: an outline is open, its line does not close; close it or take it away")
        if closed:
            half = float(line.sum()) / max(measure.perimeter(line), 1.0)
            depth = ndimage.distance_transform_edt(filled) - ndimage.distance_transform_edt(~filled)
            body = np.abs(body - np.clip(depth - half + 0.5, 0.0, 1.0))
    return body
