"""What is cut off by the end of a scan or of the modelled region is not drawn as if it ended there, and not beyond."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from phantoms import CENTRE, affine, shape

from palpate.core.surfaces.surface import Surface
from palpate.imaging.labels import BLADDER, SURROUNDING_TISSUE
from palpate.imaging.volume import Volume
from palpate.meshing.label_surfaces import wall_surface
from palpate.ui.pictures.images import CaseImages
from palpate.ui.pictures.planes import CORONAL, SAGITTAL, Plane, Window, reached
from palpate.ui.pictures.slice_axes import WALLS, draw_outlines
from palpate.ui.pictures.solids import inside


def cut_off(slices: int = 33) -> Volume:
    """A bladder in the upper half of the grid that goes on beyond its top. slices : of 3 mm, from below."""
    array = np.full(shape(), SURROUNDING_TISSUE, dtype=np.uint8)
    array[20:30, 25:40, 20:] = BLADDER
    return Volume(array[:, :, :slices], affine())


def top_of(volume: Volume) -> float:
    """z of the upper face of the highest voxels, mm."""
    return float(volume.affine[2, 3] + volume.spacing[2] * (volume.array.shape[2] - 0.5))


def drawn(images: CaseImages, plane: Plane) -> np.ndarray:
    """All points (n, 2) of the outline of the bladder: across, up, mm."""
    axes = Figure().add_subplot()
    window = Window((float(CENTRE[0]), float(CENTRE[1]), float(CENTRE[2]) + 20.0), 60.0)
    draw_outlines(axes, images, plane, window, WALLS[:1])
    return np.vstack([path.vertices for lines in axes.collections for path in lines.get_paths()])


@pytest.mark.parametrize("plane", (SAGITTAL, CORONAL), ids=lambda plane: plane.name)
@pytest.mark.parametrize("ct_slices", (None, 33, 28))
def test_an_outline_stays_open_where_labels_or_scan_end(plane: Plane, ct_slices: int | None) -> None:
    labels = cut_off()
    ct = None if ct_slices is None else Volume(np.zeros((*shape()[:2], ct_slices), np.float32), affine())
    points = drawn(CaseImages(labels, None, ct), plane)
    end = top_of(labels if ct is None else ct)
    assert end - 1.0 < points[:, 1].max() <= end
    # Its sides come up to the end; nothing is drawn from one to the other.
    above = points[points[:, 1] > end - 1.5, 0]
    middle = 0.5 * (points[:, 0].min() + points[:, 0].max())
    assert len(above) >= 2 and np.abs(above - middle).min() > 8.0


def test_a_slice_is_reached_up_to_the_outer_faces_of_the_voxels() -> None:
    labels = cut_off()
    window = Window(tuple(map(float, CENTRE)), 80.0, 1.0)
    share = reached(labels, CORONAL, window).mean() * (2 * 80.0) ** 2
    assert share == pytest.approx(50 * 2.0 * 33 * 3.0, rel=0.03)


def test_surfaces_in_three_dimensions_end_with_the_region() -> None:
    labels = cut_off()
    surface = wall_surface(labels, BLADDER)
    assert surface.points[:, 2].max() > top_of(labels) + 5.0, "carried on, to have no cap there"
    faces = inside(surface, labels)
    highest = surface.points[faces].max(axis=(0, 1))[2]
    assert top_of(labels) - 2.0 < highest <= top_of(labels)
    nothing = Surface.empty()
    assert inside(nothing, labels).shape == (0, 3)
