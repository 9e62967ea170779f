"""Where a thing of the patient comes out on the screen, whatever the grid's axes are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from phantoms import CENTRE, MARKER, affine, labels, marked_ct

from palpate.ui.pictures.images import CaseImages, stiffness_slice
from palpate.ui.pictures.planes import AXIAL, CORONAL, PLANES, SAGITTAL, Plane, Window, reslice
from palpate.ui.pictures.slice_axes import draw_background, position_text

GRIDS = [
    *((0.0, (a, b, c), "ijk") for a in (1, -1) for b in (1, -1) for c in (1, -1)),
    (0.0, (1, 1, 1), "kij"),
    (0.0, (-1, 1, -1), "jik"),
    (23.0, (1, -1, 1), "ikj"),
]
# Patient's left is on the screen's right; anterior above or left; superior above.
QUADRANT = {"axial": (+1, +1), "sagittal": (-1, +1), "coronal": (+1, +1)}


def through_marker(step_mm: float = 1.0) -> Window:
    x, y, z = MARKER
    return Window((float(x), float(y), float(z)), 45.0, step_mm)


@pytest.mark.parametrize("rotation, flips, order", GRIDS)
@pytest.mark.parametrize("plane", PLANES, ids=lambda plane: plane.name)
def test_slice_puts_every_point_where_it_lies(
    plane: Plane, rotation: float, flips: tuple[int, int, int], order: str
) -> None:
    ct = marked_ct(affine(rotation, flips, order), order)
    window = replace(through_marker(), centre=tuple(map(float, MARKER + 1.0)))  # off the marker, still through the ball
    found = reslice(ct, plane, window, -1024.0)
    across, down = found.coordinates
    weight = np.clip(found.values, 0.0, None)
    assert weight.max() > 900.0
    centre = (weight.sum(axis=0) @ across, weight.sum(axis=1) @ down) / weight.sum()
    assert np.allclose(centre, (MARKER[plane.across], MARKER[plane.down]), atol=0.6)


@pytest.mark.parametrize("plane", PLANES, ids=lambda plane: plane.name)
def test_marker_of_the_patients_left_front_top_is_drawn_in_the_right_quadrant(plane: Plane) -> None:
    matrix = affine(23.0, (1, -1, 1), "ikj")
    images = CaseImages(labels(matrix, "ikj"), None, marked_ct(matrix, "ikj"))
    window = list(CENTRE)
    window[plane.normal] = float(MARKER[plane.normal])
    figure = Figure(figsize=(4, 4), dpi=100)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    draw_background(axes, images, plane, Window((window[0], window[1], window[2]), 45.0))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    rgb = np.asarray(canvas.buffer_rgba())[..., :3].min(axis=2)
    inner = rgb[60:-60, 60:-60] > 250  # inside the letters at the edges and above the scale bar
    rows, columns = np.nonzero(inner)
    middle = (inner.shape[0] - 1) / 2.0
    right, up = np.sign(columns.mean() - middle), np.sign(middle - rows.mean())
    assert (right, up) == QUADRANT[plane.name]


def test_letters_stand_on_the_side_they_name() -> None:
    for plane, across, down in ((AXIAL, "RL", "AP"), (SAGITTAL, "AP", "SI"), (CORONAL, "RL", "SI")):
        assert (plane.left + plane.right, plane.top + plane.bottom) == (across, down)


@pytest.mark.parametrize("rotation, flips, order", GRIDS[-3:])
def test_stiffness_colours_the_half_it_belongs_to(rotation: float, flips: tuple[int, int, int], order: str) -> None:
    images = CaseImages(labels(affine(rotation, flips, order), order), None, None, {1: 120.0, 2: 40.0})
    x, y, z = (float(c) for c in CENTRE)
    value, untold = stiffness_slice(images, AXIAL, Window((x, y, z), 40.0))
    across, _ = value.coordinates
    assert np.nanmin(across[(value.values == 120.0).any(axis=0)]) > CENTRE[0] - 2.0
    assert np.nanmax(across[(value.values == 40.0).any(axis=0)]) < CENTRE[0] + 2.0
    assert np.isnan(value.values).mean() > 0.5, "nothing outside the organ is coloured"
    assert not untold.values.any()


def test_what_the_pair_does_not_tell_is_hatched_not_coloured() -> None:
    images = CaseImages(labels(affine()), None, None, {1: 120.0, 2: 40.0}, frozenset({1}))
    value, untold = stiffness_slice(images, AXIAL, images.window(AXIAL))
    assert set(np.unique(value.values[~np.isnan(value.values)])) == {40.0}
    assert untold.values.any()


def test_anisotropic_voxels_keep_their_proportions() -> None:
    found = reslice(marked_ct(affine()), CORONAL, through_marker(0.5), 0.0)
    bright = found.values > 500.0
    width, height = (bright.any(axis=axis).sum() * 0.5 for axis in (0, 1))
    assert width == pytest.approx(14.0, abs=2.0)
    assert height == pytest.approx(14.0, abs=3.0)


def test_position_names_the_axis_and_no_side_of_the_patient() -> None:
    assert position_text(AXIAL, Window((1.0, 2.0, -148.04), 10.0)) == "z = \N{MINUS SIGN}148.0 mm"
    assert position_text(SAGITTAL, Window((6.2, 2.0, 0.0), 10.0)) == "x = 6.2 mm"
