"""3D pictures without a screen, drawn in a process of their own.

A missing library ends the process that asks VTK for a window, rather than raising: only a child can be risked.
Run as ``python -m palpate.ui.pictures.offscreen SCENE.npz OUT.npz``; without arguments it draws one triangle, as a check.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyvista as pv
from vtkmodules.vtkRenderingAnnotation import vtkAnnotatedCubeActor

from palpate.core.arrays import FloatArray, IntArray, LabelArray
from palpate.ui.pictures.scene import Body, Scene, View

REMEDY = "apt-get install libegl1 libgl1-mesa-dri"
_TIMEOUT_S = 180.0


class OffscreenError(Exception):
    """There can be no 3D pictures on this machine as it is; the text says why and what would help."""


def render(scene: Scene) -> list[LabelArray]:
    """One picture (height, width, 3) per view. Raises OffscreenError where this machine cannot draw them."""
    with tempfile.TemporaryDirectory(prefix="palpate-scene-") as folder:
        given, made = Path(folder, "scene.npz"), Path(folder, "pictures.npz")
        scene.save(given)
        _child([str(given), str(made)])
        with np.load(made) as pictures:
            return [pictures[f"view{i}"] for i in range(len(scene.views))]


def begin(scene: Scene) -> Future[list[LabelArray]]:
    """`render` beside what the caller does meanwhile; its result raises what `render` raises."""
    waiting = ThreadPoolExecutor(1)  # a thread that waits for the child
    try:
        return waiting.submit(render, scene)
    finally:
        waiting.shutdown(wait=False)


def check() -> None:
    """Draws one triangle. Raises OffscreenError where this machine cannot."""
    _child([])


def _child(arguments: list[str]) -> None:
    # -P: a file beside the person, called like a library, must not stand in for it.
    command = [sys.executable, "-P", "-m", "palpate.ui.pictures.offscreen", *arguments]
    try:
        done = subprocess.run(command, capture_output=True, timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired as late:
        raise OffscreenError(f"off-screen rendering did not end within {_TIMEOUT_S:g} s") from late
    if done.returncode != 0:
        lines = [line for line in done.stderr.decode(errors="replace").splitlines() if line.strip()]
        why = lines[-1].strip() if lines else "no message"
        raise OffscreenError(f"off-screen rendering ended with status {done.returncode} ({why}); try `{REMEDY}`")


def draw(scene: Scene) -> list[LabelArray]:
    """The pictures, drawn in this very process: it dies where a library is missing."""
    plotter = pv.Plotter(off_screen=True, window_size=list(scene.size), lighting="light kit")
    plotter.set_background("white")  # type: ignore[arg-type]
    for body in scene.bodies.values():
        mesh = _polydata(body)
        smooth = body.opacity >= 1.0 and len(np.unique(body.rgb, axis=0)) == 1
        # Mostly ambient: shading tells the shape, but a colour must stay what the colour bar says.
        plotter.add_mesh(
            mesh, scalars="rgb", rgb=True, opacity=body.opacity, smooth_shading=smooth, ambient=0.55, diffuse=0.5
        )
    plotter.enable_depth_peeling(4)  # type: ignore[arg-type]
    plotter.enable_anti_aliasing("ssaa")
    pictures = []
    cube = plotter.add_orientation_widget(_cube(), viewport=(0.0, 0.0, 0.22, 0.22))  # type: ignore[arg-type]
    for view in scene.views:
        _look(plotter, scene, view)
        cube.SetEnabled(not view.left)  # letters at the edges say the same, and it would hide what is behind it
        plotter.render()  # a screenshot alone shows the view before
        pictures.append(np.asarray(plotter.screenshot(return_img=True)))
    plotter.close()
    return pictures


def _look(plotter: pv.Plotter, scene: Scene, view: View) -> None:
    centre, half = scene.reach
    towards = np.array(view.towards) / np.linalg.norm(view.towards)
    plotter.camera.parallel_projection = True
    plotter.camera.focal_point = centre.tolist()
    plotter.camera.position = (centre + 10.0 * half * towards).tolist()
    plotter.camera.up = view.up
    plotter.camera.parallel_scale = 0.5 * scene.height_mm
    plotter.renderer.ResetCameraClippingRange()


def _polydata(body: Body) -> pv.PolyData:
    mesh = polydata(body.points, body.faces)
    mesh.cell_data["rgb"] = np.rint(255.0 * body.rgb).astype(np.uint8)
    return mesh


def polydata(points: FloatArray, faces: IntArray) -> pv.PolyData:
    """VTK's form of a surface: points (n, 3), faces (f, 3)."""
    return pv.PolyData.from_regular_faces(points, faces)  # type: ignore[arg-type]  # it names Python's int as the type


def _cube() -> vtkAnnotatedCubeActor:
    cube = vtkAnnotatedCubeActor()
    for axis, plus, minus in (("X", "L", "R"), ("Y", "P", "A"), ("Z", "S", "I")):
        getattr(cube, f"Set{axis}PlusFaceText")(plus)
        getattr(cube, f"Set{axis}MinusFaceText")(minus)
    cube.SetFaceTextScale(0.65)
    # Turned so that each letter stands upright when it is looked at with superior up.
    cube.SetXFaceTextRotation(0)
    cube.SetYFaceTextRotation(0)
    cube.SetZFaceTextRotation(90)
    cube.GetCubeProperty().SetColor(0.9, 0.9, 0.9)
    cube.GetCubeProperty().SetAmbient(0.6)
    cube.GetTextEdgesProperty().SetColor(0.1, 0.1, 0.1)
    for face in ("XPlus", "XMinus", "YPlus", "YMinus", "ZPlus", "ZMinus"):
        getattr(cube, f"Get{face}FaceProperty")().SetColor(0.1, 0.1, 0.1)
    return cube


def _triangle() -> Scene:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    body = Body(points, np.array([[0, 1, 2]]), np.array([[1.0, 0.0, 0.0]]))
    return Scene({"triangle": body}, (View("front", (0.0, -1.0, 0.0), left="R"),), (64, 64))


def main(arguments: list[str]) -> int:
    """The child: draws a scene file into a file of pictures, or a triangle that must come out red."""
    if arguments:
        pictures = draw(Scene.load(Path(arguments[0])))
        np.savez(arguments[1], **{f"view{i}": picture for i, picture in enumerate(pictures)})  # type: ignore[arg-type]
        return 0
    (picture,) = draw(_triangle())
    red = (picture[..., 0] > 100) & (picture[..., 1] < 60)
    return 0 if red.any() else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
