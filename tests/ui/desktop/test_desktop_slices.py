"""What a slice view shows lies where the patient is: bright marker, letters, screen and colours."""

from __future__ import annotations

import numpy as np
import pytest
from map_arrays import two_patches
from phantoms import CENTRE, MARKER, affine, labels, marked_ct
from PySide6.QtCore import QPointF
from PySide6.QtGui import QPainterPath, QPolygonF

from palpate.imaging.grid import in_lps_order
from palpate.ui.desktop.session.display import PRESETS, Display, WindowLevel, apply_window
from palpate.ui.desktop.slices import overlay
from palpate.ui.desktop.slices.map_layer import map_layer
from palpate.ui.desktop.slices.slice_sampling import SampledSlice, cut, is_aligned, positions, scan_outline
from palpate.ui.desktop.solid.solid_shapes import map_colours
from palpate.ui.pictures.colours import StiffnessScale
from palpate.ui.pictures.planes import AXIAL, PLANES, SAGITTAL, Plane
from palpate.ui.report.regions import RegionStiffness

GRIDS = [(0.0, (1, 1, 1), "ijk"), (0.0, (-1, -1, -1), "kij"), (0.0, (1, -1, -1), "jki"), (7.0, (-1, 1, -1), "ijk")]


def place_of_brightest(sampled: SampledSlice) -> tuple[float, float]:
    """Across and down, mm, of the middle of the brightest pixels."""
    rows, columns = np.nonzero(sampled.values > 500)
    left, right, bottom, top = sampled.extent
    across = left + (columns.mean() + 0.5) * (right - left) / sampled.values.shape[1]
    return across, top + (rows.mean() + 0.5) * (bottom - top) / sampled.values.shape[0]


@pytest.mark.parametrize("plane", PLANES, ids=lambda p: p.name)
@pytest.mark.parametrize("rotation, flips, order", GRIDS)
def test_the_marker_is_where_it_is_in_the_patient(
    plane: Plane, rotation: float, flips: tuple[int, int, int], order: str
) -> None:
    ct = in_lps_order(marked_ct(affine(rotation, flips, order), order))
    assert is_aligned(ct) == (rotation == 0.0)
    sampled = cut(ct, plane, float(MARKER[plane.normal]), -1024.0)
    assert sampled is not None
    across, down = place_of_brightest(sampled)
    assert across == pytest.approx(MARKER[plane.across], abs=1.0)
    assert down == pytest.approx(MARKER[plane.down], abs=1.0)


@pytest.mark.parametrize("plane", PLANES, ids=lambda p: p.name)
def test_first_row_is_the_letter_at_the_top(plane: Plane) -> None:
    ct = marked_ct(affine())
    sampled = cut(ct, plane, float(CENTRE[plane.normal]))
    assert sampled is not None
    left, right, bottom, top = sampled.extent
    assert left < right
    # Top is anterior (lower y) on axial, superior (higher z) on the others.
    assert (top < bottom) == (plane is AXIAL)


def test_outside_of_the_volume_there_is_no_slice() -> None:
    ct = marked_ct(affine())
    first, last, step = positions(ct, AXIAL)
    assert step == pytest.approx(3.0) and last - first == pytest.approx(32 * 3.0)
    assert cut(ct, AXIAL, first - 2.0) is None and cut(ct, AXIAL, last + 2.0) is None
    assert cut(ct, AXIAL, first - 1.0) is not None


def test_an_oblique_slice_can_be_cut_in_part_and_says_so_itself() -> None:
    ct = in_lps_order(marked_ct(affine(7.0)))
    at = float(MARKER[2])
    region = (MARKER[0] - 12.0, MARKER[0] + 12.0, MARKER[1] - 12.0, MARKER[1] + 12.0)
    part = cut(ct, AXIAL, at, -1024.0, region=region)
    whole = cut(ct, AXIAL, at, -1024.0)
    assert part is not None and whole is not None and part.values.size < whole.values.size / 4
    assert place_of_brightest(part) == pytest.approx(place_of_brightest(whole), abs=0.8)
    assert cut(ct, AXIAL, at, region=(500.0, 510.0, 0.0, 10.0)) is None


def test_labels_are_never_mixed() -> None:
    volume = in_lps_order(labels(affine(11.0)))
    sampled = cut(volume, SAGITTAL, float(CENTRE[0]) + 3.0, nearest=True)
    assert (
        sampled is not None and set(np.unique(sampled.values)) <= {0, 1, 2, 3, 6} and sampled.values.dtype == np.uint8
    )


def test_window_and_level_as_dicom_defines_them() -> None:
    hu = np.array([[-160, -159, 40, 239, 240, 3000]], dtype=np.int16)
    assert apply_window(hu, WindowLevel(40.0, 400.0)).tolist() == [[0, 0, 127, 254, 255, 255]]
    moved = PRESETS["Soft tissue"].moved(1e6, -1e6)
    assert moved == WindowLevel(3071.0, 1.0)


def test_outlines_run_along_the_voxels_edges() -> None:
    values = np.zeros((6, 8), dtype=np.uint8)
    values[2:4, 3:6] = 1
    sampled = SampledSlice(values, (10.0, 26.0, 12.0, 0.0))  # 2 mm pixels, down grows downwards
    (line,) = overlay.outlines(sampled, 1)
    assert line[:, 0].min() == pytest.approx(10.0 + 3 * 2) and line[:, 0].max() == pytest.approx(10.0 + 6 * 2)
    assert line[:, 1].min() == pytest.approx(2 * 2) and line[:, 1].max() == pytest.approx(4 * 2)
    assert overlay.outlines(sampled, 2) == []


def region(label: int, G: float, ci: tuple[float, float], determined: bool = True) -> RegionStiffness:
    name = {1: "prostate_left", 2: "prostate_right"}[label]
    return RegionStiffness(name, name, G, None, ci, G / 4, G / 4, G / 4, False, determined)


def test_stiffness_outside_the_threshold_is_clear_and_unsure_stiffness_is_hatched() -> None:
    scale = StiffnessScale(0.0, 100.0)
    sure, unsure = region(1, 80.0, (70.0, 91.0)), region(2, 20.0, (5.0, 80.0))
    both = overlay.painted_stiffness(Display(opacity=0.5), [sure, unsure], scale)
    assert set(both.table) == {1, 2} and both.table[1][3] == 128 and not both.hatched
    masked = overlay.painted_stiffness(Display(surest_factor=2.0), [sure, unsure], scale)
    assert set(masked.table) == {1} and masked.hatched == {2}
    limited = overlay.painted_stiffness(Display(low_kpa=50.0), [sure, unsure], scale)
    assert set(limited.table) == {1} and not limited.hatched
    untold = overlay.painted_stiffness(Display(), [region(1, 80.0, (70.0, 91.0), determined=False)], scale)
    assert untold.hatched == {1} and not untold.table


def test_misfit_colours_are_white_where_the_model_meets_the_scan() -> None:
    rgb = overlay.residual_rgb(np.array([-9.0, 0.0, 9.0]), 2.0).astype(int)
    assert rgb[1].min() > 240 and rgb[0, 2] > rgb[0, 0] and rgb[2, 0] > rgb[2, 2]
    assert overlay.residual_limit(np.array([0.1, -1.7])) == 2.0


def test_the_map_is_painted_where_the_scans_tell_it_and_left_is_left() -> None:
    centres = np.array([[-8.0, 0.0, 0.0], [8.0, 0.0, 0.0]])
    arrays = two_patches(centres, (20.0, 80.0), 0.1).arrays() | {"told": np.array([True, False])}
    values = np.zeros((20, 20), dtype=np.uint8)
    values[5:15, 2:10], values[5:15, 10:18] = 1, 2
    sampled = SampledSlice(values, (-10.0, 10.0, 10.0, -10.0))
    display, scale = Display(opacity=1.0), StiffnessScale(0.0, 100.0)
    layer = map_layer(arrays, sampled, AXIAL, 0.0, display, scale)
    left, right = layer.data[10, 3], layer.data[10, 16]
    np.testing.assert_allclose(left[:3], 255.0 * np.array(scale.rgb(20.0)), atol=12)
    assert right[3] == 0, "what is not told is not coloured"
    assert not layer.data[values == 0].any()
    (path,) = layer.hatched
    assert not layer.stiffer and not layer.softer
    (outline,) = map_layer({**arrays, "called": np.array([1, 0])}, sampled, AXIAL, 0.0, display, scale).stiffer
    assert outline.boundingRect().right() <= 0.5, "the place that is called, and no more"
    assert path.boundingRect().left() >= 0.0 and path.boundingRect().right() <= 8.5
    assert not map_layer(arrays, sampled, AXIAL, 0.0, Display(low_kpa=50.0), scale).data.any()
    assert not map_layer(arrays, sampled, AXIAL, 0.0, Display(surest_factor=1.1), scale).data.any()
    # In 3D the same colours, and the grey that is asked for where nothing is told.
    how = {"scale": [0.0, 100.0, False], "untold": [9, 9, 9], "low_kpa": None, "high_kpa": None, "surest_factor": None}
    rgb = map_colours(arrays, centres, how)
    np.testing.assert_allclose(rgb[0], 255.0 * np.array(scale.rgb(20.0)), atol=12)
    assert rgb[1].tolist() == [9, 9, 9]
    assert map_colours(arrays, centres, {**how, "low_kpa": 50.0})[0].tolist() == [9, 9, 9]


@pytest.mark.parametrize("plane", PLANES, ids=lambda plane: plane.name)
@pytest.mark.parametrize("rotation, flips, order", GRIDS)
def test_the_outline_of_a_scan_is_where_its_voxels_end(
    plane: Plane, rotation: float, flips: tuple[int, int, int], order: str
) -> None:
    """Against the voxels themselves: a fine grid of the slice, each point in the scan or not."""
    ct = in_lps_order(marked_ct(affine(rotation, flips, order), order))
    middle = ct.to_lps((np.array([ct.array.shape]) - 1) / 2.0)[0]
    outline = scan_outline(ct, plane, float(middle[plane.normal]))
    path = QPainterPath()
    path.addPolygon(QPolygonF([QPointF(*at) for at in outline]))
    low, high = outline.min(axis=0) - 4.0, outline.max(axis=0) + 4.0
    across, down = np.meshgrid(np.linspace(low[0], high[0], 41), np.linspace(low[1], high[1], 41))
    points = np.tile(middle, (across.size, 1))
    points[:, plane.across], points[:, plane.down] = across.ravel(), down.ravel()
    index = ct.to_index(points)
    margin = np.minimum(index + 0.5, np.array(ct.array.shape) - 0.5 - index).min(axis=1)
    clear = np.abs(margin) > 1e-3
    inside = np.array([path.contains(QPointF(*at)) for at in points[:, [plane.across, plane.down]]])
    assert (inside == (margin > 0.0))[clear].all() and inside.any() and not inside.all()
    assert not len(scan_outline(ct, plane, float(middle[plane.normal]) + 1e4))
