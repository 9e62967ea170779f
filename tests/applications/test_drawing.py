"""Drawings to outlines: filled and as lines, with holes, in colours; and what is no keyframe of one figure."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw

from palpate.applications.sketch.drawings.drawing import read_drawing
from palpate.applications.sketch.extrude import mesh_figure
from palpate.core.errors import InputError

CANVAS = 400
# Neither axis is a mirror: a foot to the right, an ear to the left, a hole off the middle.
BODY = [(120, 340), (250, 340), (250, 300), (200, 290), (200, 120), (150, 60), (120, 100)]
HOLE = [(140, 140), (180, 140), (180, 200), (140, 200)]


def picture(path: Path, draw: Callable[[ImageDraw.ImageDraw], None], mode: str = "RGB") -> Path:
    image = Image.new(mode, (CANVAS, CANVAS), "white")
    draw(ImageDraw.Draw(image))
    image.save(path)
    return path


def filled(pen: ImageDraw.ImageDraw) -> None:
    pen.polygon(BODY, fill="#203060")
    pen.polygon(HOLE, fill="white")


def lines(pen: ImageDraw.ImageDraw) -> None:
    for loop in (BODY, HOLE):
        pen.line([*loop, loop[0], loop[1]], fill="black", width=5, joint="curve")


def true_area() -> float:
    x, y = np.array(BODY, dtype=float).T
    return abs(0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) - 40.0 * 60.0


SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 400">{}</svg>'
POINTS = " L ".join(f"{x},{y}" for x, y in BODY)
INNER = " L ".join(f"{x},{y}" for x, y in HOLE)


@pytest.mark.parametrize("kind", ["filled png", "line png", "filled svg", "line svg"])
def test_one_figure_reads_the_same_in_every_form(tmp_path: Path, kind: str) -> None:
    style = {"filled svg": 'fill="#203060"', "line svg": 'fill="none" stroke="black"'}.get(kind)
    if style is None:
        path = picture(tmp_path / "a.png", filled if kind == "filled png" else lines)
    else:
        path = tmp_path / "a.svg"
        path.write_text(SVG.format(f'<path {style} fill-rule="evenodd" d="M {POINTS} Z M {INNER} Z"/>'))
    found = read_drawing(path, scale=1.0)
    outline = found.outline
    assert len(outline.loops) == 2
    assert outline.area == pytest.approx(true_area(), rel=0.02)
    low, high = outline.loops[0].min(axis=0), outline.loops[0].max(axis=0)
    assert high - low == pytest.approx([130.0, 280.0], abs=3.0)
    centre = outline.loops[1].mean(axis=0) - low
    assert centre == pytest.approx([40.0, 340.0 - 170.0], abs=3.0)  # y upwards


def test_colours_are_parts_and_a_dark_outline_is_none(tmp_path: Path) -> None:
    def draw(pen: ImageDraw.ImageDraw) -> None:
        pen.rectangle((100, 100, 300, 220), fill="#4080ff")
        pen.rectangle((100, 221, 300, 340), fill="#ffb030")
        pen.line((100, 221, 300, 221), fill="#c0a074")  # a blend, as at every soft edge between two colours
        pen.rectangle((100, 100, 300, 340), outline="black", width=5)

    found = read_drawing(picture(tmp_path / "a.png", draw), size_mm=120.0)
    assert len(found.picture.colours) == 2
    x = np.array([[0.5, 0.9], [0.5, 0.1]]) * np.ptp(found.outline.points, axis=0) + found.outline.points.min(axis=0)
    upper, lower = found.part_at(x)
    assert {found.picture.colours[upper], found.picture.colours[lower]} == {"#4080ff", "#ffb030"}
    assert found.picture.colours[upper] == "#4080ff"


def open_line(pen: ImageDraw.ImageDraw) -> None:
    pen.line(BODY, fill="black", width=5)


def two(pen: ImageDraw.ImageDraw) -> None:
    pen.ellipse((50, 50, 150, 200), fill="black")
    pen.ellipse((220, 50, 320, 200), fill="black")


def cut_off(pen: ImageDraw.ImageDraw) -> None:
    pen.rectangle((100, 100, 420, 300), fill="black")


@pytest.mark.parametrize(
    ("draw", "words"),
    [
        (open_line, "the outline is open"),
        (two, "shows 2 separate shapes"),
        (lambda pen: None, "is empty: no figure is drawn"),
        (cut_off, "runs into the picture's edge|is empty"),
    ],
    ids=["open", "two", "empty", "cut off"],
)
def test_a_picture_that_is_no_keyframe_is_refused_in_one_line(
    tmp_path: Path, draw: Callable[[ImageDraw.ImageDraw], None], words: str
) -> None:
    with pytest.raises(InputError, match=words) as refused:
        read_drawing(picture(tmp_path / "a.png", draw))
    assert "a.png" in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SVG.format(f'<path fill="none" stroke="black" d="M {POINTS}"/>'), "the outline is open"),
        (
            SVG.format('<rect x="10" y="10" width="50" height="90"/><circle cx="200" cy="90" r="40"/>'),
            "2 separate shapes",
        ),
        (SVG.format(""), "is empty"),
        (SVG.format('<rect x="10" y="10" width="50" height="90" fill="none"/>'), "is empty"),
        ("<svg><path d='M 1", "not a readable SVG"),
        ('<!DOCTYPE svg [<!ENTITY a "b">]>' + SVG.format("&a;"), "defines entities"),
    ],
    ids=["open", "two", "nothing", "unpainted", "cut off", "entities"],
)
def test_an_svg_that_is_no_keyframe_is_refused_in_one_line(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "a.svg"
    path.write_text(text)
    with pytest.raises(InputError, match=words) as refused:
        read_drawing(path)
    assert "a.svg" in str(refused.value) and "\n" not in str(refused.value)


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"nothing" * 9)
    with pytest.raises(InputError, match="not a readable PNG"):
        read_drawing(tmp_path / "a.png")
    (tmp_path / "a.gif").write_bytes(b"GIF89a")
    with pytest.raises(InputError, match="no PNG or SVG"):
        read_drawing(tmp_path / "a.gif")
    with pytest.raises(InputError, match="is not there"):
        read_drawing(tmp_path / "b.png")


def test_a_figure_is_meshed_with_its_hole_and_parts(tmp_path: Path) -> None:
    outline = read_drawing(picture(tmp_path / "a.png", filled)).outline
    middle = float(outline.points[:, 1].mean())
    mesh = mesh_figure(outline, lambda x: (x[:, 1] > middle).astype(np.int64), 300)
    thickness = float(np.ptp(mesh.points[:, 2]))
    assert mesh.volumes.sum() == pytest.approx(outline.area * thickness, rel=0.03)
    assert set(mesh.regions.tolist()) == {1, 2}
