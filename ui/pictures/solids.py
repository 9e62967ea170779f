"""The 3D pictures of a case: anatomy with the organ's stiffness, and the misfit on the organ."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from textwrap import fill

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from palpate.core.arrays import FloatArray, IntArray, LabelArray
from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import LABELS
from palpate.imaging.volume import Volume
from palpate.ui.pictures.colours import AROUND_OPACITY, DISTANCE_MAP, STIFFNESS_SCALE, UNDETERMINED, label_rgb
from palpate.ui.pictures.lettering import PAGE_INCHES, TEXT
from palpate.ui.pictures.offscreen import begin
from palpate.ui.pictures.scene import ANTERIOR, LEFT, OBLIQUE, POSTERIOR, RIGHT, Body, Scene, View
from palpate.ui.pictures.slice_axes import LETTER_FONT, SCALE_BAR_MM, spread_out
from palpate.ui.pictures.slices import stiffness_bar

# Red, green, blue and opacity of what stands around the organ.
AROUND = {LABELS[label]: (*label_rgb(label), opacity) for label, opacity in AROUND_OPACITY.items()}

# A figure whose 3D pictures are being drawn beside what the caller does: the call waits for them, and raises OffscreenError where this
# machine cannot draw them.
Drawn = Callable[[], Figure]


@dataclass(frozen=True, eq=False)
class MisfitMap:
    """The deformed organ as the model predicts it, and how far each point lies outside (+) or inside (-) what the scan shows.

    points (n, 3) mm LPS, faces (f, 3), distance (n,) mm. noise_mm : what the contours' own repeatability gives; None unknown.
    greatest_mm : the largest distance, which may lie beyond the colours.
    """

    points: FloatArray
    faces: IntArray
    distance: FloatArray
    noise_mm: float | None = None
    greatest_mm: float = 0.0


def anatomy(surfaces: Mapping[str, Surface], stiffness: Mapping[int, float], region: Volume) -> Drawn:
    """The organ coloured by stiffness (grey where it is not told), bones, bladder and rectum translucent, from two sides.

    region : what the surfaces were made from: they are carried on beyond it, to have no cap there, but nothing is known of that.
    """
    organ = surfaces["organ"]
    colour = {label: STIFFNESS_SCALE.rgb(G) for label, G in stiffness.items()}
    rgb = np.array([colour.get(int(region), UNDETERMINED) for region in organ.region])
    bodies = {"organ": Body(organ.points, organ.faces, rgb)}
    for name, (r, g, b, opacity) in AROUND.items():
        if name in surfaces:
            wall = surfaces[name]
            faces = inside(wall, region)
            bodies[name] = Body(wall.points, faces, np.tile([r, g, b], (len(faces), 1)), opacity)
    views = (ANTERIOR, OBLIQUE)
    scene = Scene(bodies, views, (800, 800), "organ")
    pictures = begin(scene)

    def finish() -> Figure:
        figure = Figure(figsize=(PAGE_INCHES, 3.7), layout="constrained")
        axes = figure.subplots(1, 2)
        for ax, picture, view in zip(axes, pictures.result(), views, strict=True):
            _show(ax, picture, view, scene.height_mm, 40)
        if stiffness:
            stiffness_bar(figure, list(axes), 0.85)
        return figure

    return finish


def inside(surface: Surface, region: Volume) -> IntArray:
    """The faces of a surface all of whose points lie within the voxels of ``region``."""
    index = region.to_index(surface.points)
    outside = np.any((index < -0.5) | (index > np.array(region.array.shape) - 0.5), axis=1)
    return surface.faces[~np.any(outside[surface.faces], axis=1)]


def misfit(found: MisfitMap) -> Drawn:
    """The misfit on the predicted organ from four sides."""
    limit = max(float(np.percentile(np.abs(found.distance), 98)), 0.5, found.noise_mm or 0.0)
    limit = float(np.ceil(limit / 0.5) * 0.5)
    norm, colours = Normalize(-limit, limit), colormaps[DISTANCE_MAP]
    beyond = "both" if found.greatest_mm > limit else "neither"
    rgb = colours(norm(found.distance[found.faces].mean(axis=1)))[:, :3]
    views = (ANTERIOR, POSTERIOR, LEFT, RIGHT)
    scene = Scene({"organ": Body(found.points, found.faces, rgb)}, views, (500, 500))
    pictures = begin(scene)

    def finish() -> Figure:
        figure = Figure(figsize=(PAGE_INCHES, 2.5), layout="constrained")
        axes = figure.subplots(1, 4)
        spread_out(figure)
        for ax, picture, view in zip(axes, pictures.result(), views, strict=True):
            _show(ax, picture, view, scene.height_mm, 15)
        bar = figure.colorbar(ScalarMappable(norm, colours), ax=list(axes), shrink=0.95, aspect=18, extend=beyond)
        bar.set_label("predicted outside (+) or\ninside (\N{MINUS SIGN}) the scan's, mm", fontsize=TEXT)
        bar.ax.tick_params(labelsize=TEXT)
        for sign in (-1.0, 1.0):
            if found.noise_mm is not None and found.noise_mm < limit:
                bar.ax.axhline(sign * found.noise_mm, color="black", linewidth=0.8)
        return figure

    return finish


def _show(axes: Axes, picture: LabelArray, view: View, height_mm: float, letters: int) -> None:
    """height_mm : of the whole picture. letters : of the title's lines."""
    axes.imshow(picture)
    axes.set_axis_off()
    axes.set_title(fill(view.name, letters), fontsize=TEXT)
    places = ((view.left, 0.05, 0.5), (view.right, 0.95, 0.5), (view.top, 0.5, 0.96), (view.bottom, 0.5, 0.04))
    for letter, x, y in places:
        axes.text(
            x, y, letter, transform=axes.transAxes, fontsize=TEXT, fontweight="bold", ha="center", va="center",
            family=LETTER_FONT,
        )  # fmt: skip
    _scale_bar(axes, picture.shape[0], picture.shape[1], height_mm)


def _scale_bar(axes: Axes, rows: int, columns: int, height_mm: float) -> None:
    """At the lower right, where no cube stands."""
    length = SCALE_BAR_MM * rows / height_mm
    right, y = 0.97 * columns, 0.965 * rows
    axes.plot([right - length, right], [y, y], color="black", linewidth=2.0, solid_capstyle="butt")
    axes.text(right - 0.5 * length, y - 0.015 * rows, f"{SCALE_BAR_MM:.0f} mm", fontsize=TEXT, ha="center", va="bottom")
