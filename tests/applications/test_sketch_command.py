"""The sketch command: drawings to try, a film from them, and one line for what is no keyframe."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from films import read_film
from PIL import Image, ImageDraw

from palpate.applications.sketch.motion import MotionOptions
from palpate.applications.sketch.pictures.example import letter_loops, write_example
from palpate.applications.sketch.pictures.frames import write_sketch
from palpate.applications.sketch.run_sketch import run_sketch
from palpate.applications.sketch.sketch_options import SketchOptions
from palpate.ui.cli.main import main


def test_letters_stand_on_their_feet() -> None:
    for letter, holes in (("P", 1), ("A", 1), ("L", 0)):
        loops = letter_loops(letter)
        every = np.vstack(loops)
        assert len(loops) == 1 + holes
        assert every[:, 1].min() == pytest.approx(0.0, abs=1e-9) and np.ptp(every[:, 1]) == pytest.approx(1.0)


def test_a_letter_becomes_a_film_that_hits_its_keyframes(tmp_path: Path) -> None:
    keys = write_example(tmp_path / "letters", "L")
    options = SketchOptions(cells=150, highest_degree=0, motion=MotionOptions(leg=3, still=1, beyond=1, swing=3))
    sketch = run_sketch(keys, options)
    summary = write_sketch(sketch, tmp_path / "film")
    assert summary["held"] == ["bottom"] and summary["hit"], summary["keyframes"]
    assert summary["parts"] == [
        {"colour": "#3b6ea5", "G_over_first": 1.0, "sd_ln": 0.0, "ci95": [1.0, 1.0], "told": True}
    ]
    assert "twice the stiffness under twice the forces" in summary["in_words"][0]
    assert json.loads((tmp_path / "film" / "sketch.json").read_text()) == summary
    pictures = sorted((tmp_path / "film" / "pictures").iterdir())
    film = read_film(tmp_path / "film" / "film.mp4")
    assert len(pictures) == len(film) == summary["pictures"] == 13
    ink = [float((np.asarray(Image.open(p)) < 250).mean()) for p in pictures]
    assert min(ink) > 0.05 and max(ink) < 0.5
    assert np.abs(film[0].astype(int) - film[5].astype(int)).mean() > 2.0  # it moves


def drawing(path: Path, *boxes: tuple[int, int, int, int]) -> Path:
    image = Image.new("RGB", (300, 300), "white")
    for corners in boxes:
        ImageDraw.Draw(image).rectangle(corners, fill="black")
    image.save(path)
    return path


def test_wrong_drawings_get_one_line_and_leave_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good = drawing(tmp_path / "good.png", (100, 100, 200, 250))
    two = drawing(tmp_path / "two.png", (50, 100, 100, 250), (150, 100, 200, 250))
    empty = drawing(tmp_path / "empty.png")
    for wrong, words in ((two, "2 separate shapes"), (empty, "is empty"), (tmp_path / "none.svg", "is not there")):
        assert main(["sketch", str(good), str(wrong), "-o", str(tmp_path / "out"), "--quiet"]) == 3
        said = capsys.readouterr().err.strip()
        assert words in said and "\n" not in said
        assert not (tmp_path / "out").exists()
    assert main(["sketch", str(good), "-o", str(tmp_path / "out"), "--quiet"]) == 2
    assert main(["sketch", str(good), str(good), "-o", str(tmp_path), "--quiet"]) == 3  # a folder of other things
