"""3D pictures: drawn in a child process, from the side that is written under them."""

from __future__ import annotations

import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv

from palpate.ui.pictures import offscreen
from palpate.ui.pictures.scene import ANTERIOR, LEFT, POSTERIOR, RIGHT, Body, Scene, View

VIEWS = (ANTERIOR, POSTERIOR, LEFT, RIGHT)


def ball_scene() -> Scene:
    """A ball of 20 mm radius whose faces are red on the patient's left, green behind and blue above, from four sides."""
    ball = pv.Sphere(radius=20.0, center=(50.0, -30.0, 10.0), theta_resolution=40, phi_resolution=40)
    faces = ball.regular_faces
    centres = ball.points[faces].mean(axis=1) - [50.0, -30.0, 10.0]
    return Scene({"ball": Body(np.asarray(ball.points), faces, (centres > 0.0).astype(float))}, VIEWS, (120, 120))


@pytest.fixture(scope="module")
def pictures() -> dict[str, np.ndarray]:
    drawn = offscreen.render(ball_scene())
    return {view.name: picture.astype(int) for view, picture in zip(VIEWS, drawn, strict=True)}


def test_the_scale_of_a_picture_is_the_one_it_is_drawn_at(pictures: dict[str, np.ndarray]) -> None:
    """The ball is 40 mm high in every view."""
    for picture in pictures.values():
        rows = np.flatnonzero((picture.min(axis=2) < 200).any(axis=1))
        assert (rows[-1] - rows[0] + 1) * ball_scene().height_mm / len(picture) == pytest.approx(40.0, abs=1.5)


@pytest.mark.parametrize(
    "view, left, right",
    [
        (ANTERIOR, (0, 0, 1), (1, 0, 1)),
        (POSTERIOR, (1, 1, 1), (0, 1, 1)),
        (LEFT, (1, 0, 1), (1, 1, 1)),
        (RIGHT, (0, 1, 1), (0, 0, 1)),
    ],
    ids=lambda value: getattr(value, "name", str(value)),
)
def test_each_view_shows_the_side_it_names(
    pictures: dict[str, np.ndarray], view: View, left: tuple[int, int, int], right: tuple[int, int, int]
) -> None:
    picture = pictures[view.name]
    for colour, column in ((left, 45), (right, 75)):
        upper, lower = picture[45, column], picture[75, column]
        assert tuple(int(value > 60) for value in upper) == colour
        assert tuple(int(value > 60) for value in lower) == (*colour[:2], 0), "superior is up"


def test_a_child_that_dies_is_an_error_that_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    dead = SimpleNamespace(returncode=-11, stderr=b"libEGL.so.1: cannot open shared object file\n")
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: dead)
    with pytest.raises(offscreen.OffscreenError, match=r"status -11 .*libEGL.*apt-get install libegl1"):
        offscreen.check()


def test_scene_survives_the_way_to_the_child(tmp_path: Path) -> None:
    body = Body(np.eye(3), np.array([[0, 1, 2]]), np.array([[0.1, 0.2, 0.3]]), 0.4)
    Scene({"a": body}, VIEWS, (30, 40), "a").save(tmp_path / "scene.npz")
    back = Scene.load(tmp_path / "scene.npz")
    assert (back.views, back.size, back.focus, back.bodies["a"].opacity) == (VIEWS, (30, 40), "a", 0.4)
    assert np.array_equal(back.bodies["a"].rgb, body.rgb)
