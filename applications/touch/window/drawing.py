"""The process that draws the organ under the probe: ``python -m palpate.applications.touch.window.drawing``.

| type | further keys |
| --- | --- |
| body | file: npz with points (s, 3), faces (f, 3), rgb (f, 3) |
| view | id, size, azimuth, elevation, zoom, centre, half, u (base64 of (s, 3) float32, or null), probe [x, y, z, radius] or null, grips |

Answers are those of `drawing_child`.
"""

from __future__ import annotations

import base64
import sys

import numpy as np
import pyvista as pv

from palpate.core.arrays import LabelArray
from palpate.ui.desktop.solid.camera import Camera
from palpate.ui.desktop.solid.drawing_child import off_screen_plotter, picture, serve_scene
from palpate.ui.desktop.solid.pipe_child import Message

# The dent must be seen through the probe.
_CLEAR = 0.5
_PRESSING, _GRIPPING = "#d9dde2", "#ff5fd2"


class TouchScene:
    """What is drawn."""

    def __init__(self) -> None:
        self._plotter = off_screen_plotter(samples=4)
        self._organ = pv.PolyData()
        self._rest = np.zeros((0, 3))
        self._probe: pv.Actor | None = None

    def take(self, message: Message) -> None:
        """The organ."""
        with np.load(message["file"]) as arrays:
            self._rest = arrays["points"]
            faces, rgb = arrays["faces"], arrays["rgb"]
        self._organ = pv.PolyData(self._rest, np.column_stack([np.full(len(faces), 3), faces]))
        self._organ.cell_data["rgb"] = rgb.astype(np.uint8)
        self._plotter.add_mesh(
            self._organ, scalars="rgb", rgb=True, name="organ", show_edges=True, edge_color="#20262d", line_width=1,
            ambient=0.25, diffuse=0.75, specular=0.1, reset_camera=False, render=False,
        )  # fmt: skip
        self._probe = self._plotter.add_mesh(
            pv.Sphere(radius=1.0, theta_resolution=40, phi_resolution=28), name="probe", color=_PRESSING, opacity=_CLEAR,
            smooth_shading=True, specular=0.6, specular_power=20, reset_camera=False, render=False,
        )  # fmt: skip

    def draw(self, view: Message) -> LabelArray:
        """The picture of a view, (height, width, 3)."""
        self._plotter.window_size = list(view["size"])
        u = np.zeros_like(self._rest)
        if view["u"] is not None:
            u = np.frombuffer(base64.b64decode(view["u"]), dtype=np.float32).reshape(-1, 3).astype(float)
        self._organ.points = self._rest + u
        self._place(view["probe"], view["grips"])
        camera = Camera(view["azimuth"], view["elevation"], view["zoom"], np.array(view["centre"]), view["half"])
        return picture(self._plotter, camera, view["size"])

    def _place(self, probe: list[float] | None, grips: bool) -> None:
        if self._probe is None:
            return
        self._probe.visibility = probe is not None
        if probe is not None:
            self._probe.position = probe[:3]
            self._probe.scale = [probe[3]] * 3
            self._probe.prop.color = _GRIPPING if grips else _PRESSING


if __name__ == "__main__":
    sys.exit(serve_scene(TouchScene()))
