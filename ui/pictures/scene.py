"""What a 3D picture shows, as plain arrays that can travel to another process."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

import numpy as np

from palpate.core.arrays import FloatArray, IntArray

_ARRAYS = ("points", "faces", "rgb")


class _ViewFacts(TypedDict):
    name: str
    towards: tuple[float, float, float]
    up: tuple[float, float, float]
    left: str
    right: str
    top: str
    bottom: str


class _SceneFacts(TypedDict):
    views: list[_ViewFacts]
    size: tuple[int, int]
    focus: str | None
    bodies: dict[str, float]


@dataclass(frozen=True, eq=False)
class Body:
    """A surface: points (n, 3) mm LPS, faces (f, 3), rgb (f, 3) 0 to 1 of each face, opacity 0 to 1."""

    points: FloatArray
    faces: IntArray
    rgb: FloatArray
    opacity: float = 1.0


@dataclass(frozen=True)
class View:
    """From where to look: towards (3,) is the direction from the scene's centre to the eye, up (3,) is up on the screen.

    left, right, top, bottom : letters at the picture's edges; empty in an oblique view, which shows a cube instead.
    """

    name: str
    towards: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    left: str = ""
    right: str = ""
    top: str = "S"
    bottom: str = "I"


# LPS: -y is anterior. From in front, the patient's right is on the screen's left.
ANTERIOR = View("from the front", (0.0, -1.0, 0.0), left="R", right="L")
POSTERIOR = View("from behind", (0.0, 1.0, 0.0), left="L", right="R")
LEFT = View("from the patient's left", (1.0, 0.0, 0.0), left="A", right="P")
RIGHT = View("from the patient's right", (-1.0, 0.0, 0.0), left="P", right="A")
OBLIQUE = View("from the front, left and above", (0.55, -1.0, 0.45), top="", bottom="")


@dataclass(frozen=True, eq=False)
class Scene:
    """Bodies, the views of them, and the size of each picture in pixels. focus : name of the body to look at, or all."""

    bodies: Mapping[str, Body]
    views: tuple[View, ...]
    size: tuple[int, int] = (700, 700)
    focus: str | None = None

    @property
    def reach(self) -> tuple[FloatArray, float]:
        """Centre (3,) mm of what is looked at, and its radius, mm."""
        names = [self.focus] if self.focus else list(self.bodies)
        points = np.vstack([self.bodies[name].points for name in names])
        low, high = points.min(axis=0), points.max(axis=0)
        return (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0

    @property
    def height_mm(self) -> float:
        """How many millimetres a picture is high, the same at every depth: the projection is parallel."""
        return 2.0 * (1.9 if self.focus else 0.85) * self.reach[1]

    def save(self, path: Path) -> None:
        """Writes the scene for the process that draws it."""
        facts = {
            "views": [view.__dict__ for view in self.views],
            "size": self.size,
            "focus": self.focus,
            "bodies": {name: body.opacity for name, body in self.bodies.items()},
        }
        arrays = {f"{name}/{key}": getattr(body, key) for name, body in self.bodies.items() for key in _ARRAYS}
        np.savez(path, facts=np.array(json.dumps(facts)), **arrays)

    @classmethod
    def load(cls, path: Path) -> Scene:
        """The scene of a file of ``save``."""
        with np.load(path, allow_pickle=False) as data:
            facts: _SceneFacts = json.loads(str(data["facts"]))
            bodies = {
                name: Body(data[f"{name}/points"], data[f"{name}/faces"], data[f"{name}/rgb"], opacity)
                for name, opacity in facts["bodies"].items()
            }
        views = tuple(_view(view) for view in facts["views"])
        width, height = facts["size"]
        return cls(bodies, views, (width, height), facts["focus"])


def _view(facts: _ViewFacts) -> View:
    """JSON made lists of the tuples."""
    (x, y, z), (ux, uy, uz) = facts["towards"], facts["up"]
    return View(facts["name"], (x, y, z), (ux, uy, uz), facts["left"], facts["right"], facts["top"], facts["bottom"])
