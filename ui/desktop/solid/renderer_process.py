"""The process that draws the window's 3D view: the window never waits for it, and a broken graphics library ends only this one.

``python -m palpate.ui.desktop.solid.renderer_process`` reads one JSON object a line; answers are those of `drawing_child`.

| type | further keys |
| --- | --- |
| labels | state, file (NumPy, uint8), affine |
| scan | file (NumPy), affine: the scan whose slices are shown in space |
| points | file (NumPy, (n, 7): x, y, z, residual, r, g, b) or null: misfit on the organ |
| view | id, size, azimuth, elevation, zoom, crosshair, states, colours, planes, window, residual, map, fast |

`colours` is {label: [r, g, b, opacity 0 to 1]}.

`map` is null, or what colours the organ at rest: file (of the stiffness map), version (changes with the file), scale (low, high,
logarithmic, colour map), untold (r, g, b), low_kpa, high_kpa, surest_factor as in `Display`.
"""

from __future__ import annotations

import sys

import numpy as np
import pyvista as pv
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.labels import BLADDER, BONE, ORGAN_LABELS, RECTUM
from palpate.imaging.volume import Volume
from palpate.ui.desktop.session.display import WindowLevel, apply_window
from palpate.ui.desktop.slices.slice_sampling import cut
from palpate.ui.desktop.solid.camera import Camera
from palpate.ui.desktop.solid.drawing_child import off_screen_plotter, picture, serve_scene
from palpate.ui.desktop.solid.pipe_child import Message
from palpate.ui.desktop.solid.solid_shapes import map_colours, near, quad_of, surface
from palpate.ui.desktop.solid.view_request import MapRequest
from palpate.ui.pictures.images import AIR_HU
from palpate.ui.pictures.planes import PLANES

_DRAWN = (*ORGAN_LABELS, BLADDER, RECTUM, BONE)


class SolidScene:
    """What is drawn, and how it was last asked for."""

    def __init__(self) -> None:
        # Multisampling and depth peeling exclude each other: walls would not be drawn at all.
        self._plotter = off_screen_plotter(samples=0)
        self._plotter.enable_depth_peeling(4)  # type: ignore[arg-type]
        self._plotter.enable_anti_aliasing("fxaa")
        self._bodies: dict[tuple[str, int], pv.Actor] = {}
        self._scan: Volume | None = None
        self._centre, self._half = np.zeros(3), 60.0
        self._points: FloatArray | None = None
        self._map: tuple[tuple[str, int], dict[str, NDArray[np.generic]]] | None = None

    def take(self, message: Message) -> None:
        """New labels, another scan or other points."""
        {"labels": self._take_labels, "scan": self._take_scan, "points": self._take_points}[message["type"]](message)

    def _take_labels(self, message: Message) -> None:
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

    def _take_scan(self, message: Message) -> None:
        """The scan whose slices are shown."""
        self._scan = Volume(np.load(message["file"], mmap_mode="r"), np.array(message["affine"]))
        if not self._bodies:
            middle = (np.array(self._scan.array.shape) - 1) / 2.0
            self._centre = self._scan.to_lps(middle[None])[0]
            self._half = 0.5 * float((self._scan.spacing * self._scan.array.shape).max())

    def _take_points(self, message: Message) -> None:
        """Misfit on the organ at rest, or nothing."""
        self._points = None if message["file"] is None else np.load(message["file"])

    def draw(self, message: Message) -> LabelArray:
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
        half = 1.05 * self._half
        camera = Camera(message["azimuth"], message["elevation"], message["zoom"], self._centre, half)
        return picture(plotter, camera, message["size"])

    def _paint(self, actor: pv.Actor, residual: bool, by_map: MapRequest | None) -> None:
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

    def _planes(self, message: Message) -> None:
        at = message["crosshair"]
        if self._scan is None:
            return
        for plane in PLANES:
            name = f"plane {plane.name}"
            wanted = plane.name in message["planes"]
            sampled = cut(self._scan, plane, at[plane.normal], AIR_HU) if wanted else None
            sampled = None if sampled is None else near(sampled, plane, self._centre, 1.1 * self._half)
            if sampled is None:
                self._plotter.remove_actor(name, render=False)  # type: ignore[arg-type]
                continue
            quad = quad_of(sampled, plane, at[plane.normal])
            grey = apply_window(sampled.values, WindowLevel(*message["window"]))
            texture = pv.Texture(np.ascontiguousarray(np.repeat(grey[..., None], 3, axis=2)))
            self._plotter.add_mesh(
                quad, texture=texture, name=name, lighting=False, render=False, reset_camera=False, opacity=1.0
            )


if __name__ == "__main__":
    sys.exit(serve_scene(SolidScene()))
