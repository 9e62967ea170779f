"""The folder that a sketch leaves: film, pictures, figures."""

from __future__ import annotations

import json
from pathlib import Path

from PIL import Image

from palpate.applications.film import write_film
from palpate.applications.sketch.pictures.frames import film_pictures, keyframe_sheet
from palpate.applications.sketch.run_sketch import Sketch
from palpate.applications.sketch.sketch_summary import SketchRecord
from palpate.core.files.atomic import atomic_folder


def write_sketch(sketch: Sketch, folder: Path, per_second: float = 25.0) -> SketchRecord:
    """Writes film.mp4, pictures/0001.png ..., keyframes.png and sketch.json, whole or not at all; returns what sketch.json says."""
    pictures = list(film_pictures(sketch))
    with atomic_folder(folder) as made:
        (made / "pictures").mkdir()
        for k, picture in enumerate(pictures, start=1):
            Image.fromarray(picture).save(made / "pictures" / f"{k:04d}.png")
        codec = write_film(made / "film.mp4", pictures, per_second)
        keyframe_sheet(sketch).savefig(made / "keyframes.png", dpi=110)
        summary: SketchRecord = {**sketch.summary, "film": {"codec": codec, "per_second": per_second}}
        (made / "sketch.json").write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    return summary
