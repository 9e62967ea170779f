"""The process that draws the window's 3D view: the window never waits for it, and a broken graphics library ends only this one.

``python -m palpate.ui.desktop.solid_child`` reads one JSON object a line and answers each view that it draws with one line
{"id", "width", "height"} and then the pixels, three bytes each. Of views that have waited only the last is drawn.

| type | further keys |
| --- | --- |
| labels | state, file (NumPy, uint8), affine |
| scan | file (NumPy), affine: the scan whose slices are shown in space |
| points | file (NumPy, (n, 7): x, y, z, residual, r, g, b) or null: misfit on the organ |
| view | id, size, azimuth, elevation, zoom, crosshair, states, colours, planes, window, residual, map, fast |

`colours` is {label: [r, g, b, opacity 0 to 1]}.

`map` is null, or what colours the organ at rest: file (of the stiffness map), version (changes with the file), scale (low, high,
logarithmic), untold (r, g, b), low_kpa, high_kpa, surest_factor as in `Display`.
"""

from __future__ import annotations

import json
import os
import select
import sys
from typing import Any

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from palpate.core.worker.lifeline import die_with_parent, give_way
from palpate.segmentation.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.segmentation.volume import Volume
from palpate.ui.desktop import overlay
from palpate.ui.desktop.grey import WindowLevel, to_grey
from palpate.ui.desktop.sheets import Sheet, cut
from palpate.ui.pictures.colours import StiffnessScale
from palpate.ui.pictures.images import AIR_HU
from palpate.ui.pictures.planes import PLANES, Plane

_DRAWN = (*ORGAN_LABELS, BLADDER, RECTUM, BONE)
_SMOOTH_VOXELS = 0.8
# More are not seen in a view of this size and cost time without a graphics card.
_MOST_FACES = 12_000
_GROUND = "#15181c"


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


class SolidScene:
    """What is drawn, and how it was last asked for."""

    def __init__(self) -> None:
        self._plotter = pv.Plotter(off_screen=True, window_size=[400, 400], lighting="light kit")
        self._plotter.set_background(_GROUND)  # type: ignore[arg-type]
        self._plotter.enable_parallel_projection()  # type: ignore[call-arg]
        # Multisampling and depth peeling exclude each other: walls would not be drawn at all.
        self._plotter.render_window.SetMultiSamples(0)  # type: ignore[union-attr]
        self._plotter.enable_depth_peeling(4)  # type: ignore[arg-type]
        self._plotter.enable_anti_aliasing("fxaa")
        self._bodies: dict[tuple[str, int], Any] = {}
        self._scan: Volume | None = None
        self._centre, self._half = np.zeros(3), 60.0
        self._points: NDArray[np.float64] | None = None
        self._map: tuple[tuple[str, int], dict[str, NDArray[Any]]] | None = None

    def take_labels(self, message: dict[str, Any]) -> None:
        """New labels of one state."""
        labels = Volume(np.load(message["file"]), np.array(message["affine"]))
        for label in _DRAWN:
            name = f"{message['state']} {label}"
            self._plotter.remove_actor(name, render=False)  # type: ignore[arg-type]
            self._bodies.pop((message["state"], label), None)
            shape = surface(labels, label)
            if shape is not None:
                # Mostly ambient: shading tells the shape, but a colour must stay what the colour bar says.
                actor = self._plotter.add_mesh(
                    shape, name=name, color="white", smooth_shading=True, ambient=0.45, diffuse=0.6, render=False,
                    reset_camera=False, show_scalar_bar=False,
                )  # fmt: skip
                self._bodies[message["state"], label] = actor
        shapes = [actor.mapper.dataset.points for (_, label), actor in self._bodies.items() if label != BONE]
        if shapes:
            points = np.vstack(shapes)
            low, high = points.min(axis=0), points.max(axis=0)
            self._centre, self._half = (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0

    def take_scan(self, message: dict[str, Any]) -> None:
        """The scan whose slices are shown."""
        self._scan = Volume(np.load(message["file"], mmap_mode="r"), np.array(message["affine"]))
        if not self._bodies:
            middle = (np.array(self._scan.array.shape) - 1) / 2.0
            self._centre = self._scan.to_lps(middle[None])[0]
            self._half = 0.5 * float((self._scan.spacing * self._scan.array.shape).max())

    def take_points(self, message: dict[str, Any]) -> None:
        """Misfit on the organ at rest, or nothing."""
        self._points = None if message["file"] is None else np.load(message["file"])

    def draw(self, message: dict[str, Any]) -> NDArray[np.uint8]:
        """The picture of a view, (height, width, 3)."""
        plotter = self._plotter
        plotter.window_size = list(message["size"])
        plotter.renderer.SetUseDepthPeeling(not message.get("fast"))
        for (state, label), actor in self._bodies.items():
            r, g, b, opacity = message["colours"].get(f"{state} {label}", (0.0, 0.0, 0.0, 0.0))
            actor.visibility = state in message["states"] and opacity > 0.0
            actor.prop.color, actor.prop.opacity = (r, g, b), opacity
            if state == "rest" and label in ORGAN_LABELS and actor.visibility:
                self._paint(actor, bool(message.get("residual")), message.get("map"))
        self._planes(message)
        self._look(message)
        plotter.render()
        return np.asarray(plotter.screenshot(return_img=True))[:, :, :3]

    def _paint(self, actor: Any, residual: bool, by_map: dict[str, Any] | None) -> None:
        """Colours the organ at rest point by point, by misfit or by the map, or leaves it in its one colour."""
        mapper = actor.mapper
        mapper.SetScalarVisibility(False)
        shape = mapper.GetInput()
        points = vtk_to_numpy(shape.GetPoints().GetData())
        if residual and self._points is not None:
            nearest = cKDTree(self._points[:, :3]).query(points)[1]
            rgb = self._points[nearest, 4:7].astype(np.uint8)
        elif by_map is not None:
            key = (by_map["file"], by_map["version"])
            if self._map is None or self._map[0] != key:
                with np.load(by_map["file"], allow_pickle=False) as archive:
                    self._map = (key, {name: archive[name] for name in archive.files})
            rgb = map_colours(self._map[1], points.astype(np.float64), by_map)
        else:
            return
        colours = numpy_to_vtk(np.ascontiguousarray(rgb), deep=True)
        colours.SetName("colours")
        shape.GetPointData().AddArray(colours)
        mapper.SetScalarModeToUsePointFieldData()
        mapper.SelectColorArray("colours")
        mapper.SetColorModeToDirectScalars()
        mapper.SetScalarVisibility(True)

    def _planes(self, message: dict[str, Any]) -> None:
        at = message["crosshair"]
        if self._scan is None:
            return
        for plane in PLANES:
            name = f"plane {plane.name}"
            wanted = plane.name in message["planes"]
            sheet = (
                _near(cut(self._scan, plane, at[plane.normal], AIR_HU), plane, self._centre, 1.1 * self._half)
                if wanted
                else None
            )
            if sheet is None:
                self._plotter.remove_actor(name, render=False)  # type: ignore[arg-type]
                continue
            quad = _quad(sheet, plane, at[plane.normal])
            grey = to_grey(sheet.values, WindowLevel(*message["window"]))
            texture = pv.Texture(np.ascontiguousarray(np.repeat(grey[..., None], 3, axis=2)))
            self._plotter.add_mesh(
                quad, texture=texture, name=name, lighting=False, render=False, reset_camera=False, opacity=1.0
            )

    def _look(self, message: dict[str, Any]) -> None:
        azimuth, elevation = np.deg2rad(message["azimuth"]), np.deg2rad(message["elevation"])
        towards = np.array(
            [np.cos(elevation) * np.sin(azimuth), -np.cos(elevation) * np.cos(azimuth), np.sin(elevation)]
        )
        camera = self._plotter.camera
        camera.focal_point = self._centre.tolist()
        camera.position = (self._centre + 10.0 * self._half * towards).tolist()
        camera.up = (0.0, 0.0, 1.0)
        width, height = message["size"]
        camera.parallel_scale = 1.05 * self._half * max(1.0, height / width) / message["zoom"]
        self._plotter.renderer.ResetCameraClippingRange()


def map_colours(arrays: dict[str, NDArray[Any]], points: NDArray[np.float64], how: dict[str, Any]) -> NDArray[np.uint8]:
    """Colours (n, 3) of points (n, 3) mm by the stiffness map, as the slices have them. how : `map` of a view."""
    scale = StiffnessScale(*how["scale"])
    G, told = overlay.map_at(arrays, points, how["surest_factor"])
    low, high = how["low_kpa"] or -np.inf, how["high_kpa"] or np.inf
    rgb = np.rint(255.0 * scale.colormap(scale.norm(G))[:, :3]).astype(np.uint8)
    rgb[~told | (low > G) | (high < G)] = how["untold"]
    return rgb


def _near(sheet: Sheet | None, plane: Plane, centre: NDArray[np.float64], reach: float) -> Sheet | None:
    """The part of a sheet around the organ: the whole pelvis would hide it."""
    if sheet is None:
        return None
    left, _, _, top = sheet.extent
    step_a, step_d = sheet.step
    first = int(np.floor((centre[plane.across] - reach - left) / step_a))
    last = int(np.ceil((centre[plane.across] + reach - left) / step_a))
    middle = plane.down_sign * (centre[plane.down] - top)
    upper, lower = int(np.floor((middle - reach) / step_d)), int(np.ceil((middle + reach) / step_d))
    rows, columns = sheet.values.shape
    first, last, upper, lower = max(first, 0), min(last, columns), max(upper, 0), min(lower, rows)
    if first >= last or upper >= lower:
        return None
    y0, y1 = (top + plane.down_sign * step_d * edge for edge in (upper, lower))
    return Sheet(sheet.values[upper:lower, first:last], (left + step_a * first, left + step_a * last, y1, y0))


def _quad(sheet: Sheet, plane: Plane, position: float) -> pv.PolyData:
    left, right, bottom, top = sheet.extent
    corners = np.full((4, 3), float(position))
    corners[:, plane.across] = (left, right, right, left)
    corners[:, plane.down] = (bottom, bottom, top, top)
    quad = pv.PolyData(corners, np.array([4, 0, 1, 2, 3]))
    quad.active_texture_coordinates = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    return quad


def main() -> int:
    """Answers till standard input ends."""
    die_with_parent()
    give_way()
    out = os.dup(1)
    os.dup2(2, 1)  # what libraries print must not come between pictures
    scene = SolidScene()
    takers = {"labels": scene.take_labels, "scan": scene.take_scan, "points": scene.take_points}
    waiting = b""
    view: dict[str, Any] | None = None
    while True:
        while b"\n" in waiting:
            line, _, waiting = waiting.partition(b"\n")
            message = json.loads(line)
            if message["type"] == "view":
                view = message
            else:
                takers[message["type"]](message)
        more, _, _ = select.select([0], [], [], 0.0 if view else None)
        if more:
            read = os.read(0, 65536)
            if not read:
                return 0
            waiting += read
        elif view is not None:
            picture = scene.draw(view)
            head = {"id": view["id"], "width": picture.shape[1], "height": picture.shape[0]}
            _write(out, json.dumps(head).encode() + b"\n" + np.ascontiguousarray(picture).tobytes())
            view = None


def _write(descriptor: int, data: bytes) -> None:
    while data:
        data = data[os.write(descriptor, data) :]


if __name__ == "__main__":
    sys.exit(main())
