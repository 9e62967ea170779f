"""The window of `palpate touch`: geometry of its picture, the window without a screen, and under a real X display by real mouse events."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from x_display import needs_xvfb, x_display

from palpate.applications.touch.body import Body
from palpate.applications.touch.body_file import load_body, save_body
from palpate.applications.touch.touch_study import halved_ellipsoid
from palpate.applications.touch.window.child import Child
from palpate.core.mesh import TetMesh
from palpate.ui.desktop.solid.camera import Camera, first_hit

# Plays a script in a window of its own process: Qt allows one application in a process.
PLAY = """
import json, sys
from pathlib import Path
from palpate.applications.touch.body_file import load_body
from palpate.applications.touch.window.touch_application import Playing, Probed, show
from palpate.applications.touch.window.touch_script import parse
from palpate.ui.pictures.colours import STIFFNESS_SCALE
folder, headless = Path(sys.argv[1]), sys.argv[2] == "headless"
script = folder / "script.txt"
commands = parse(script.read_text(), str(script))
body = load_body(folder / "organ.npz")
probed = Probed(body, 7.0, STIFFNESS_SCALE)
found = show(probed, folder / "kept", headless, Playing(commands, folder, str(script)))
print(json.dumps(found["events"]))
"""


def organ() -> Body:
    """Off its place, soft on the patient's left."""
    body = halved_ellipsoid(4, 2)
    mesh = TetMesh(body.mesh.points + [-12.0, 30.0, -150.0], body.mesh.cells, body.mesh.regions)
    return Body(mesh, {1: 20.0, 2: 60.0}, {1: "prostate_left", 2: "prostate_right"})


def play(folder: Path, script: str, how: str) -> list[dict[str, Any]]:
    save_body(folder / "organ.npz", organ())
    (folder / "script.txt").write_text(script)
    done = subprocess.run(
        [sys.executable, "-c", PLAY, str(folder), how], capture_output=True, text=True, timeout=150, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    events: list[dict[str, Any]] = json.loads(done.stdout.strip().splitlines()[-1])
    return events


def picture(path: Path) -> NDArray[Any]:
    return np.asarray(Image.open(path).convert("RGB")).astype(int)


def test_a_pixel_and_its_ray_are_the_same_place() -> None:
    camera = Camera(25.0, -35.0, 1.4, np.array([-12.0, 30.0, -150.0]), 30.0)
    point = np.array([3.0, 20.0, -140.0])
    x, y = camera.pixel(point, 800, 600)
    origin, direction = camera.ray(x, y, 800, 600)
    along = (point - origin) @ direction
    assert along > 0.0 and np.allclose(origin + along * direction, point)
    # From the front the patient's left (+x in LPS) is on the right of the picture, the head (+z) at its top.
    front = Camera(0.0, 0.0, 1.0, np.zeros(3), 30.0)
    assert front.pixel(np.array([5.0, 0.0, 0.0]), 100, 100)[0] > 50.0
    assert front.pixel(np.array([0.0, 0.0, 5.0]), 100, 100)[1] < 50.0


def test_a_ray_meets_the_near_side() -> None:
    surface = organ().surface
    camera = Camera(-40.0, 10.0, 1.0, surface.rest.mean(axis=0), 30.0)
    found = first_hit(surface.rest, surface.local_faces, *camera.ray(320.0, 240.0, 640, 480))
    assert found is not None
    hit = found[1] @ surface.rest[surface.local_faces[found[0]]]
    assert np.allclose(camera.pixel(hit, 640, 480), (320.0, 240.0)) and (hit - camera.centre) @ camera.axes[2] > 10.0
    assert first_hit(surface.rest, surface.local_faces, *camera.ray(2.0, 2.0, 640, 480)) is None


def test_the_answering_process_keeps_only_the_last_place_of_the_mouse(tmp_path: Path) -> None:
    save_body(tmp_path / "organ.npz", organ())
    again = load_body(tmp_path / "organ.npz")
    assert again.shear_kpa == {1: 20.0, 2: 60.0} and again.names[2] == "prostate_right"
    child, heard = Child(), []

    def answer(head: dict[str, Any], data: bytes) -> None:
        heard.append((head, data))

    child.handle([{"type": "body", "id": 1, "file": str(tmp_path / "organ.npz"), "radius": 7.0}], answer)
    places = [{"type": "at", "id": 3 + k, "point": [20.0, 30.0, -150.0], "depth": 0.5 * k} for k in range(4)]
    child.handle(
        [
            {"type": "touch", "id": 2, "point": [20.0, 30.0, -150.0]},
            *places,
            {"type": "press", "id": 9, "depth": float("nan")},
        ],
        answer,
    )
    assert [head["type"] for head, _ in heard] == ["ready", "felt", "felt", "refused"]
    last, data = heard[2]
    assert last["id"] == 6 and last["facts"]["indentation_mm"] == 1.5 and last["rows"][-1][3] > 0.1
    u = np.frombuffer(data, dtype=np.float32).reshape(-1, 3)
    assert len(u) == len(again.surface.nodes) and u[:, 0].min() < -0.5
    assert heard[3][0]["reason"] == "nan mm is no depth"


SCRIPT = """
resize 1000 700
turn 35 15
touch 40 30 -150
press 3.5
expect region prostate_left
screenshot left.png
turn -35 15
hold -31 30 -150 80
above force_n 0.5
expect region prostate_right
screenshot pressed.png
lift
below force_n 0.01
hold -31 30 -150 -60
below force_n -0.3
screenshot pulled.png
lift
click save the curve
"""


def hard(shot: np.ndarray) -> np.ndarray:
    """Where a picture is as green as 60 kPa on the one scale of stiffness."""
    return np.asarray(shot[..., 1] - shot[..., 2] > 40)


def soft(shot: np.ndarray) -> np.ndarray:
    """Where it is as blue as 20 kPa."""
    return np.asarray((shot[..., 2] - shot[..., 1] > 15) & (shot[..., 2] - shot[..., 0] > 40))


def check(folder: Path, events: list[dict[str, Any]]) -> None:
    left, held = (next(e for e in events if e["command"] == name) for name in ("press", "hold"))
    assert left["indentation_mm"] == 3.5 and held["indentation_mm"] == pytest.approx(80 / 25)
    assert held["force_n"] > 1.3 * left["force_n"], "the hard half is felt no harder"
    shots = {name: picture(folder / f"{name}.png") for name in ("left", "pressed", "pulled")}
    if all(event.get("settled", True) for event in events):
        organ_part = shots["pressed"][60:600, 60:600]
        assert hard(organ_part).sum() > 8000 and soft(organ_part).sum() > 8000, "both halves are to be seen"
        assert np.abs(shots["pressed"] - shots["pulled"])[60:600, 60:600].sum() > 3e5
    assert all(shot.std() > 20 for shot in shots.values())
    assert (folder / "kept" / "curve_1.csv").read_text().count("prostate_right") > 20
    assert picture(folder / "kept" / "curve_1.png").std() > 20


def test_the_window_without_a_screen(tmp_path: Path) -> None:
    turned = "resize 900 600\nturn 0 0\ntouch -12 0 -150\npress 2\nslide 5 0 -150\nexpect region prostate_left\nscreenshot front.png\n"
    events = play(tmp_path, turned, "headless")
    shot = picture(tmp_path / "front.png")[60:560, 20:520]
    if events[-1]["settled"]:
        left, right = (np.argwhere(half(shot))[:, 1].mean() for half in (soft, hard))
        assert left > right + 50, "the patient's left is not on the right of the picture"


@needs_xvfb
def test_the_window_on_an_x_display(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with x_display(tmp_path, "1300x900", monkeypatch):
        check(tmp_path, play(tmp_path, SCRIPT, "screen"))
