"""The film of a drop, drawn and written in a process of its own, as `offscreen` does it and for its reason.

Run as ``python -m palpate.applications.drop.film STAGE.npz OUT.mp4``; it tells on standard output how many pictures are done.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyvista as pv
from numpy.typing import NDArray

from palpate.applications.drop.canvas import Canvas
from palpate.applications.drop.stage import DropStage, FallingOrgan
from palpate.applications.film import write_film
from palpate.core.arrays import FloatArray
from palpate.core.surfaces.triangles import area_vectors, point_normals
from palpate.core.worker.progress import Progress, silent
from palpate.ui.pictures.offscreen import REMEDY, OffscreenError, polydata

Picture = NDArray[np.uint8]

_TOWARDS = np.array([0.0, -1.0, 0.32])  # from the patient's front, a little from above
_MARGIN = 1.06
_DISH_COLOUR = (0.72, 0.76, 0.80)


def make_film(stage: DropStage, path: Path, progress: Progress = silent) -> str:
    """Draw and write the film; returns the codec's name. Raises OffscreenError where this machine cannot.

    Whatever ends it, the process that draws is gone.
    """
    with tempfile.TemporaryDirectory(prefix="palpate-drop-") as folder:
        given = Path(folder, "stage.npz")
        stage.save(given)
        command = [sys.executable, "-P", "-m", "palpate.applications.drop.film", str(given), str(path)]
        with Path(folder, "errors.txt").open("w+b") as errors:
            child = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
            try:
                codec = _listen(child, len(stage.times), progress)
                status = child.wait()
            finally:
                child.kill()
                child.wait()
            if status != 0 or not codec:
                errors.seek(0)
                lines = [line for line in errors.read().decode(errors="replace").splitlines() if line.strip()]
                why = lines[-1].strip() if lines else f"status {status}"
                raise OffscreenError(f"the film could not be drawn ({why}); try `{REMEDY}`")
    return codec


def _listen(child: subprocess.Popen[str], count: int, progress: Progress) -> str:
    """The codec that the child names at its end; before, it tells the numbers of finished pictures."""
    codec = ""
    assert child.stdout is not None
    for line in child.stdout:
        word, _, value = line.strip().partition(" ")
        if word == "picture":
            progress(int(value) / count, f"picture {value} of {count}")
        elif word == "codec":
            codec = value
    return codec


def pictures(stage: DropStage) -> Iterator[Picture]:
    """Every picture of the film, drawn in this very process."""
    frame = Frame.around(stage)
    canvas = Canvas(stage, frame.pixels_per_mm)
    plots = [_Plot(stage, organ, frame) for organ in stage.organs]
    for k in range(len(stage.times)):
        yield canvas.picture([plot.picture(k) for plot in plots], float(stage.times[k]))
    for plot in plots:
        plot.close()


class Frame:
    """The part of space that every picture shows, in parallel projection: lengths across it are true.

    centre (3,) mm, half : half of its height, mm.
    """

    def __init__(self, centre: FloatArray, half: float, size: tuple[int, int]) -> None:
        self.centre, self.half, self.size = centre, half, size

    @property
    def pixels_per_mm(self) -> float:
        """Of a picture of `size` pixels."""
        return self.size[1] / (2.0 * self.half)

    @classmethod
    def around(cls, stage: DropStage) -> Frame:
        """Holds the dish and every organ at every time."""
        x = np.vstack([stage.dish_points, *(o.points.reshape(-1, 3) for o in stage.organs)])
        back = _TOWARDS / np.linalg.norm(_TOWARDS)
        up = np.array([0.0, 0.0, 1.0]) - back[2] * back
        axes = np.stack([np.cross(up, back), up, back])
        axes /= np.linalg.norm(axes, axis=1, keepdims=True)
        low, high = (x @ axes.T).min(axis=0), (x @ axes.T).max(axis=0)
        width, height = stage.size
        half = 0.5 * _MARGIN * max(float(high[1] - low[1]), float(high[0] - low[0]) * height / width)
        return cls(0.5 * (low + high) @ axes, half, stage.size)


class _Plot:
    """One organ on its dish."""

    def __init__(self, stage: DropStage, organ: FallingOrgan, frame: Frame) -> None:
        self._organ = organ
        self._plotter = pv.Plotter(off_screen=True, window_size=list(stage.size), lighting="light kit")
        self._plotter.set_background("white")  # type: ignore[arg-type]
        self._add_dish(stage)
        self._parts = []
        for colour in np.unique(organ.rgb, axis=0):
            part = polydata(organ.points[0], organ.faces[(organ.rgb == colour).all(axis=1)])
            part.point_data.active_normals = point_normals(organ.points[0], organ.faces)
            self._parts.append(part)
            # Mostly ambient, as in the still pictures: a colour must stay what the colour bar says.
            self._plotter.add_mesh(
                part, color=tuple(colour), smooth_shading=True, ambient=0.5, diffuse=0.55, specular=0.15,
                show_edges=True, edge_color="black", edge_opacity=0.25, line_width=0.7,
            )  # fmt: skip
        self._plotter.enable_anti_aliasing("ssaa")
        camera = self._plotter.camera
        camera.parallel_projection = True
        camera.focal_point = frame.centre.tolist()
        camera.position = (frame.centre + 10.0 * frame.half * _TOWARDS / np.linalg.norm(_TOWARDS)).tolist()
        camera.up = (0.0, 0.0, 1.0)
        camera.parallel_scale = frame.half
        self._plotter.renderer.ResetCameraClippingRange()

    def _add_dish(self, stage: DropStage) -> None:
        """The far wall solid, the near one, seen from outside, like glass: what lies in the dish shows, and no two glasses overlap."""
        x, faces = stage.dish_points, stage.dish_faces
        normals = point_normals(x, faces)
        inside = area_vectors(x[faces]) @ _TOWARDS > 0.0
        for seen, opacity in ((inside, 1.0), (~inside, 0.4)):
            part = polydata(x, faces[seen])
            part.point_data.active_normals = normals
            self._plotter.add_mesh(
                part, color=_DISH_COLOUR, smooth_shading=True, opacity=opacity, ambient=0.4, diffuse=0.55
            )

    def picture(self, k: int) -> Picture:
        """(height, width, 3) at time k."""
        x = self._organ.points[k]
        normals = point_normals(x, self._organ.faces)
        for part in self._parts:
            part.points = x
            part.point_data.active_normals = normals
        self._plotter.render()
        return np.asarray(self._plotter.screenshot(return_img=True))[..., :3]

    def close(self) -> None:
        """Free the window."""
        self._plotter.close()


def main(arguments: list[str]) -> int:
    """The child: a stage's file into a film."""
    stage = DropStage.load(Path(arguments[0]))

    def counted() -> Iterator[Picture]:
        for k, picture in enumerate(pictures(stage), 1):
            yield picture
            sys.stdout.write(f"picture {k}\n")
            sys.stdout.flush()

    codec = write_film(Path(arguments[1]), counted(), stage.per_second)
    sys.stdout.write(f"codec {codec}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
