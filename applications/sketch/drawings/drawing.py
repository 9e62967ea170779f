"""A drawn keyframe: one figure's outline, and where its parts of different colour are, from a PNG or SVG file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy import ndimage
from skimage import measure

from palpate.applications.sketch.drawings.picture import Picture
from palpate.applications.sketch.drawings.png import read_png
from palpate.applications.sketch.drawings.svg import read_svg
from palpate.applications.sketch.outline import Outline, resampled_loop, signed_area
from palpate.core.arrays import FloatArray, IntArray
from palpate.core.errors import InputError

# Other shapes with less than this share of the figure's area are specks; holes with less are blots.
_SPECK, _BLOT = 0.01, 0.004
# A figure smaller than this share of its picture is hardly meant.
_SMALLEST = 0.001
# Steps along an outline, in figure sizes, and how far its corners are rounded (standard deviation, in pixels).
_STEP, _SOFTEN = 0.004, 0.8


@dataclass(frozen=True, eq=False)
class Drawing:
    """outline : mm, x to the right, y upwards. scale : mm per unit of the file. notes : one line each."""

    outline: Outline
    picture: Picture
    scale: float
    notes: tuple[str, ...]

    def part_at(self, x: FloatArray) -> IntArray:
        """(n,) the part's number at points (n, 2) mm, that of the nearest pixel of the figure."""
        inside = self.picture.solid >= 0.5
        nearest = ndimage.distance_transform_edt(~inside, return_distances=False, return_indices=True)
        at = (x / self.scale - self.picture.origin) / self.picture.pixel
        rows = np.clip((len(inside) - at[:, 1]).astype(int), 0, inside.shape[0] - 1)
        columns = np.clip(at[:, 0].astype(int), 0, inside.shape[1] - 1)
        return self.picture.parts[tuple(nearest[:, rows, columns])]


def read_drawing(path: Path, scale: float | None = None, size_mm: float = 100.0) -> Drawing:
    """The one figure of a PNG or SVG file.

    scale : mm per unit of the file; None makes the figure `size_mm` large. Raises InputError naming the file when it shows no figure,
    several, or a line that does not close.
    """
    if not path.is_file():
        raise InputError(f"{path} is not there; give the path of a drawing (PNG or SVG)")
    kinds = {".png": read_png, ".svg": read_svg}
    if path.suffix.lower() not in kinds:
        raise InputError(f"{path} is no PNG or SVG file; save the drawing in one of these forms")
    picture = kinds[path.suffix.lower()](path)
    solid, notes = _one_figure(picture.solid, path)
    loops = _loops(solid, path)
    if scale is None:
        scale = size_mm / (picture.pixel * float(np.ptp(loops[0], axis=0).max()))
    step = _STEP * float(np.ptp(loops[0], axis=0).max())
    fine = [resampled_loop(loop, max(16, round(len(loop) / 2 / step))) for loop in loops]
    outline = Outline(tuple(scale * (picture.origin + picture.pixel * loop) for loop in fine))
    kept = replace(picture, solid=solid)
    return Drawing(outline, kept, scale, (*picture.notes, *notes))


def _one_figure(solid: FloatArray, path: Path) -> tuple[FloatArray, list[str]]:
    """The figure alone, its blots filled."""
    number, count = ndimage.label(solid >= 0.5, structure=np.ones((3, 3)))
    areas = np.bincount(number.ravel())[1:]
    if count == 0 or areas.max() < _SMALLEST * solid.size:
        raise InputError(f"{path} is empty: no figure is drawn in it; draw one closed figure, dark on white")
    shapes = int((areas >= _SPECK * areas.max()).sum())
    if shapes > 1:
        raise InputError(f"{path} shows {shapes} separate shapes; draw one figure in one piece")
    notes = [f"{count - 1} specks were left out"] if count > 1 else []
    own = ndimage.binary_dilation(number == areas.argmax() + 1, iterations=2)
    kept = np.where(own, solid, 0.0)
    holes, count = ndimage.label(kept < 0.5)
    sizes = np.bincount(holes.ravel())
    small = [k for k in range(1, count + 1) if sizes[k] < _BLOT * areas.max()]
    if small:
        kept[np.isin(holes, small)] = 1.0
        notes.append(f"{len(small)} blots in the figure were filled")
    return kept, notes


def _loops(solid: FloatArray, path: Path) -> list[FloatArray]:
    """Outer loop and holes, pixels, x to the right and y upwards from the picture's lower left corner."""
    padded = np.pad(ndimage.gaussian_filter(solid, _SOFTEN), 1)
    if max(edge.max() for edge in (solid[0], solid[-1], solid[:, 0], solid[:, -1])) > 0.5:
        raise InputError(f"{path}: the figure runs into the picture's edge; leave a margin around it")
    found = [loop[:-1] for loop in measure.find_contours(padded, 0.5) if len(loop) > 12]
    upright = [np.column_stack([loop[:, 1] - 0.5, len(solid) - (loop[:, 0] - 0.5)]) for loop in found]
    upright.sort(key=lambda loop: -abs(signed_area(loop)))
    outer = upright[0] if signed_area(upright[0]) > 0.0 else upright[0][::-1]
    smallest = _BLOT * signed_area(outer)
    holes = [loop for loop in upright[1:] if abs(signed_area(loop)) > smallest]
    return [outer, *(loop if signed_area(loop) < 0.0 else loop[::-1] for loop in holes)]
