"""The motion that the images tell, as arrows on the slices, and the points that were rejected."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from palpate.core.arrays import FloatArray, IntArray
from palpate.core.matched_motion import MatchedMotion
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.lettering import TEXT
from palpate.ui.pictures.planes import Plane, Window
from palpate.ui.pictures.slice_axes import outlined_planes

# Points within this distance of a slice are shown on it, mm.
SLAB_MM = 4.0
_USED, _REJECTED = "#35d0ff", "#ff5a4d"


def motion_planes(images: CaseImages, matched: MatchedMotion) -> Figure:
    """Axial, sagittal and coronal slice with every matched point near it: an arrow of true length, a cross where rejected.

    Of a motion that an image tells in some directions only, the rest is the model's prediction.
    """
    figure, shown = outlined_planes(images, 3.5)
    for axes, plane, window in shown:
        _arrows(axes, plane, window, matched.points, matched.moved)
        bad = matched.rejected[_near(plane, window, matched.rejected[:, :3])]
        axes.plot(bad[:, plane.across], bad[:, plane.down], "x", color=_REJECTED, markersize=3.5, markeredgewidth=0.9)
    used = Line2D([], [], color=_USED, label=f"matched ({len(matched.points)} points in all)")
    crosses = Line2D([], [], color=_REJECTED, marker="x", linestyle="", label=f"rejected ({len(matched.rejected)})")
    figure.legend(handles=[used, crosses], loc="outside lower center", ncols=2, fontsize=TEXT, frameon=False)
    return figure


def _arrows(axes: Axes, plane: Plane, window: Window, points: FloatArray, moved: FloatArray) -> None:
    here = _near(plane, window, points)
    x, y = points[here, plane.across], points[here, plane.down]
    dx, dy = moved[here, plane.across], moved[here, plane.down]
    axes.quiver(x, y, dx, dy, color=_USED, angles="xy", scale_units="xy", scale=1.0, width=0.006, headwidth=4.0)


def _near(plane: Plane, window: Window, points: FloatArray) -> IntArray:
    """Indices of points (n, 3) mm within the slice's slab and its field of view."""
    away = np.abs(points - np.array(window.centre))
    inside = (away[:, [plane.across, plane.down]] < window.half_mm).all(axis=1)
    return np.flatnonzero(inside & (away[:, plane.normal] < SLAB_MM))
