"""What the processes that draw in 3D share: a plotter without a screen, how it looks, and the answers to views.

Of views that wait together only the last is drawn; the answer is {"id", "width", "height"} and the pixels, three bytes each.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import pyvista as pv

from palpate.core.arrays import LabelArray
from palpate.ui.desktop.solid.camera import Camera
from palpate.ui.desktop.solid.pipe_child import Answer, Message, serve

_GROUND = "#15181c"


class Scene(Protocol):
    """What is drawn."""

    def take(self, message: Message) -> None:
        """A message that asks for no picture."""

    def draw(self, view: Message) -> LabelArray:
        """The picture of a view, (height, width, 3)."""


def off_screen_plotter(samples: int) -> pv.Plotter:
    """A plotter in parallel projection on the windows' ground. samples : of each pixel, 0 for one."""
    plotter = pv.Plotter(off_screen=True, window_size=[400, 400], lighting="light kit")
    plotter.set_background(_GROUND)  # type: ignore[arg-type]
    plotter.enable_parallel_projection()  # type: ignore[call-arg]
    plotter.render_window.SetMultiSamples(samples)  # type: ignore[union-attr]
    return plotter


def picture(plotter: pv.Plotter, camera: Camera, size: Sequence[int]) -> LabelArray:
    """What a camera sees, (height, width, 3). size : width and height, as the plotter's window has them already."""
    towards = camera.axes[2]
    plotter.camera.focal_point = camera.centre.tolist()
    plotter.camera.position = (camera.centre + 10.0 * camera.half * towards).tolist()
    plotter.camera.up = (0.0, 0.0, 1.0)
    plotter.camera.parallel_scale = 0.5 * size[1] * camera.mm_per_pixel(size[0], size[1])
    plotter.renderer.ResetCameraClippingRange()
    plotter.render()
    return np.asarray(plotter.screenshot(return_img=True))[:, :, :3]


def handler(scene: Scene) -> Callable[[list[Message], Answer], None]:
    """For `serve`: gives the scene its messages, and answers the last view among them."""

    def handle(messages: list[Message], answer: Answer) -> None:
        view = None
        for message in messages:
            if message["type"] == "view":
                view = message
            else:
                scene.take(message)
        if view is not None:
            drawn = scene.draw(view)
            head = {"id": view["id"], "width": drawn.shape[1], "height": drawn.shape[0]}
            answer(head, np.ascontiguousarray(drawn).tobytes())

    return handle


def serve_scene(scene: Scene) -> int:
    """Draws till standard input ends; 0."""
    return serve(handler(scene), gives_way=True)
