"""The shapes and colours of the window's 3D view: organs from labels, a slice in space, the map on the organ."""

from __future__ import annotations

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy import ndimage

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.map_values import map_at
from palpate.ui.desktop.slices.slice_sampling import SampledSlice
from palpate.ui.desktop.solid.view_request import MapRequest
from palpate.ui.pictures.colours import StiffnessScale
from palpate.ui.pictures.planes import Plane

_SMOOTH_VOXELS = 0.8
# More are not seen in a view of this size and cost time without a graphics card.
_MOST_FACES = 12_000


def surface(labels: Volume, label: int) -> pv.PolyData | None:
    """A smooth surface of one label, mm; None where there is none."""
    index = np.argwhere(labels.array == label)
    if not len(index):
        return None
    low, high = np.maximum(index.min(axis=0) - 3, 0), index.max(axis=0) + 4
    part = (labels.array[tuple(slice(a, b) for a, b in zip(low, high, strict=True))] == label).astype(np.float32)
    field = np.pad(ndimage.gaussian_filter(np.pad(part, 2), _SMOOTH_VOXELS), 1)
    grid = pv.ImageData(dimensions=field.shape)
    grid.point_data["share"] = field.ravel(order="F")
    shape = grid.contour([0.5], scalars="share", method="flying_edges")
    if shape.n_points == 0:
        return None
    shape.points = labels.to_lps(np.asarray(shape.points) + low - 3)
    if shape.n_cells > _MOST_FACES:
        shape = shape.decimate(1.0 - _MOST_FACES / shape.n_cells)
    return shape.compute_normals(auto_orient_normals=True)


def near(sampled: SampledSlice, plane: Plane, centre: FloatArray, reach: float) -> SampledSlice | None:
    """The part of a slice within `reach` mm of a centre (3,), None where there is none: the whole pelvis would hide the organ."""
    left, _, _, top = sampled.extent
    step_a, step_d = sampled.step
    first = int(np.floor((centre[plane.across] - reach - left) / step_a))
    last = int(np.ceil((centre[plane.across] + reach - left) / step_a))
    middle = plane.down_sign * (centre[plane.down] - top)
    upper, lower = int(np.floor((middle - reach) / step_d)), int(np.ceil((middle + reach) / step_d))
    rows, columns = sampled.values.shape
    first, last, upper, lower = max(first, 0), min(last, columns), max(upper, 0), min(lower, rows)
    if first >= last or upper >= lower:
        return None
    y0, y1 = (top + plane.down_sign * step_d * edge for edge in (upper, lower))
    return SampledSlice(sampled.values[upper:lower, first:last], (left + step_a * first, left + step_a * last, y1, y0))


def quad_of(sampled: SampledSlice, plane: Plane, position: float) -> pv.PolyData:
    """A slice as one square in space with texture coordinates. position : mm along the plane's normal."""
    left, right, bottom, top = sampled.extent
    corners = np.full((4, 3), float(position))
    corners[:, plane.across] = (left, right, right, left)
    corners[:, plane.down] = (bottom, bottom, top, top)
    quad = pv.PolyData(corners, np.array([4, 0, 1, 2, 3]))
    quad.active_texture_coordinates = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return quad


def map_colours(arrays: dict[str, NDArray[np.generic]], points: FloatArray, how: MapRequest) -> LabelArray:
    """Colours (n, 3) of points (n, 3) mm by the stiffness map, as the slices have them. how : `map` of a view."""
    scale = StiffnessScale(*how["scale"])
    G, told = map_at(arrays, points, how["surest_factor"])
    low, high = how["low_kpa"] or -np.inf, how["high_kpa"] or np.inf
    rgb = np.rint(255.0 * scale.colormap(scale.norm(G))[:, :3]).astype(np.uint8)
    rgb[~told | (low > G) | (high < G)] = how["untold"]
    return rgb
