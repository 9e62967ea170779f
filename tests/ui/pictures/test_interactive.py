"""The view that turns and plays: what its data say, and that it needs no network."""

import base64
import json
import re
from typing import Any

import numpy as np
import pytest

from palpate.ui.pictures.colours import StiffnessScale
from palpate.ui.pictures.interactive import MovingBody, deformation_page

CORNERS = np.array([[0.0, 0.0, 0.0], [30.0, 0.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 10.0], [99.0, 99.0, 99.0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
MOVE = np.tile([1.0, -2.0, 4.0], (5, 1))


def body(name: str = "prostate left", move: np.ndarray = MOVE) -> MovingBody:
    return MovingBody.of(name, CORNERS, move, FACES, np.tile([0.2, 0.5, 0.3], (4, 1)), 1.0)


def figure_of(page: str) -> dict[str, Any]:
    """What the page hands to its drawing program: traces and frames."""
    data = re.search(r"Plotly\.newPlot\(\s*\"[^\"]+\",\s*(\[.*?\]),\s*\{\"", page, re.S)
    frames = re.search(r"Plotly\.addFrames\('[^']+',\s*(\[.*?\])\)", page, re.S)
    assert data is not None
    return {"data": json.loads(data[1]), "frames": json.loads(frames[1]) if frames else []}


def numbers(coded: dict[str, str]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(coded["bdata"]), dtype=np.dtype(coded["dtype"]))


def test_last_frame_is_the_deformed_state_and_the_first_is_at_rest() -> None:
    figure = figure_of(deformation_page([body()], StiffnessScale(0.0, 60.0)))
    mesh = figure["data"][0]
    assert mesh["name"] == "prostate left"
    np.testing.assert_allclose(numbers(mesh["x"]), CORNERS[:4, 0])
    first, last = figure["frames"][0], figure["frames"][-1]
    assert (first["name"], last["name"]) == ("0", "100")
    for axis, name in enumerate("xyz"):
        np.testing.assert_allclose(numbers(first["data"][0][name]), CORNERS[:4, axis])
        np.testing.assert_allclose(numbers(last["data"][0][name]), CORNERS[:4, axis] + MOVE[:4, axis])


def test_what_stands_still_has_no_frames() -> None:
    still = body("bone", np.zeros((5, 3)))
    figure = figure_of(deformation_page([body(), still], None))
    assert all(frame["traces"] == [0] for frame in figure["frames"])
    assert figure_of(deformation_page([still], None))["frames"] == []


def test_letters_stand_where_the_patient_has_them() -> None:
    page = deformation_page([body()], None)
    block = re.search(r'"annotations":(\[.*?\])', page, re.S)
    assert block is not None
    letters = {a["text"]: (a["x"], a["y"], a["z"]) for a in json.loads(block[1])}
    assert letters["L"][0] > letters["R"][0]
    assert letters["P"][1] > letters["A"][1]
    assert letters["S"][2] > letters["I"][2]


def test_the_page_brings_its_program_along() -> None:
    page = deformation_page([body()], StiffnessScale(1.0, 100.0, True))
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=", page)
    assert len(page) > 1_000_000
    assert "shear modulus G (kPa)" in page


@pytest.mark.parametrize("ends", [(0.0, 60.0, False), (2.0, 200.0, True)])
def test_colour_bar_is_the_scale(ends: tuple[float, float, bool]) -> None:
    scale = StiffnessScale(*ends)
    bar = figure_of(deformation_page([body()], scale))["data"][-1]["marker"]["colorbar"]
    for place, text in zip(bar["tickvals"], bar["ticktext"], strict=True):
        assert place == pytest.approx(float(scale.norm(float(text))))
    assert len(bar["tickvals"]) >= 4
