"""What a film of a drop shows, as plain arrays that can travel to another process."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class FallingOrgan:
    """title, subtitle : over its picture. points : (frames, n, 3) mm, +z up; faces (f, 3); rgb : (f, 3) 0 to 1."""

    title: str
    subtitle: str
    points: FloatArray
    faces: IntArray
    rgb: FloatArray


@dataclass(frozen=True, eq=False)
class DropStage:
    """organs : side by side, each on its own dish of points (n, 3) mm and faces (f, 3). times : (frames,) s.

    per_second : pictures a second of film. bar : labels of the colour bar by their place on it, 0 to 1. colours : (k, 3) along it.
    """

    organs: tuple[FallingOrgan, ...]
    dish_points: FloatArray
    dish_faces: IntArray
    times: FloatArray
    per_second: float
    bar: tuple[tuple[float, str], ...]
    bar_title: str
    colours: FloatArray
    size: tuple[int, int] = (640, 720)

    def save(self, path: Path) -> None:
        """Writes it for the process that draws it."""
        facts = {"titles": [[o.title, o.subtitle] for o in self.organs], "per_second": self.per_second, "bar": self.bar,
                 "bar_title": self.bar_title, "size": self.size}  # fmt: skip
        arrays = {
            "dish_points": self.dish_points,
            "dish_faces": self.dish_faces,
            "times": self.times,
            "colours": self.colours,
        }
        for k, organ in enumerate(self.organs):
            arrays |= {f"{k}/points": organ.points, f"{k}/faces": organ.faces, f"{k}/rgb": organ.rgb}
        np.savez(path, facts=np.array(json.dumps(facts)), **arrays)  # type: ignore[arg-type]

    @classmethod
    def load(cls, path: Path) -> DropStage:
        """The stage of a file of ``save``."""
        with np.load(path, allow_pickle=False) as data:
            facts = json.loads(str(data["facts"]))
            organs = tuple(
                FallingOrgan(title, subtitle, data[f"{k}/points"], data[f"{k}/faces"], data[f"{k}/rgb"])
                for k, (title, subtitle) in enumerate(facts["titles"])
            )
            bar = tuple((float(place), str(text)) for place, text in facts["bar"])
            return cls(organs, data["dish_points"], data["dish_faces"], data["times"], facts["per_second"], bar,
                       facts["bar_title"], data["colours"], tuple(facts["size"]))  # fmt: skip
