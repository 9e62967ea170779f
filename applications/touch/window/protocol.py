"""The probe of `palpate touch`: what a person or a script asks of the probe, answered by the mechanics and told in plain facts."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from pathlib import Path
from typing import NotRequired, TypedDict

import numpy as np

from palpate.applications.touch.body import Body
from palpate.applications.touch.session import Answer, Session
from palpate.applications.touch.window.force_curve import CurveRow, curve_csv, force_curve
from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.files.atomic import atomic_path
from palpate.ui.words.number_words import three_figures

# A press by a script goes there in steps of at most so much, and a slide too, mm.
PRESS_STEP, SLIDE_STEP = 0.25, 1.0
_DPI = 150


def stiffness_words(G: float, interval: Sequence[float] | None) -> str:
    """A shear modulus, kPa, and its 95 % interval where that is known."""
    return f"G = {three_figures(G)} kPa" + (
        "" if interval is None else f" ({three_figures(interval[0])} to {three_figures(interval[1])})"
    )


class Felt(TypedDict):
    """What the probe feels: where it is, mm, the force there, and whether there is an equilibrium; more of it once it touches.

    point, normal : (3,) of the surface at rest. error_n : of the quick answer, by its own estimate. solve : "quick" or "full".
    """

    answers: int
    probe_radius_mm: float
    touch: NotRequired[int]
    region: str | None
    G_kpa: NotRequired[float]
    G_ci95_kpa: NotRequired[Sequence[float] | None]
    point: NotRequired[list[float]]
    normal: NotRequired[list[float]]
    indentation_mm: float
    force_n: float
    stiffness_n_per_mm: float | None
    error_n: NotRequired[float]
    solve: NotRequired[str]
    ok: bool
    said: NotRequired[str]
    milliseconds: NotRequired[float]
    answers_per_second: NotRequired[int]


class Saved(Felt):
    """The same with the files that the curve was written to."""

    files: list[str]


class ProbeControl:
    """session : the body and the probe. depth : mm, where the probe is now. rows : the curve, answers with an equilibrium."""

    def __init__(self, body: Body, radius: float = 8.0) -> None:
        self.session = Session(body, radius)
        self.depth = 0.0
        self.answer: Answer | None = None
        self.rows: list[CurveRow] = []
        self.milliseconds = 0.0

    def touch(self, point: FloatArray) -> Felt:
        """The probe comes to the place of the surface nearest to a point (3,) mm and just touches it."""
        self.session.touch(point)
        return self.go(0.0)

    def go(self, depth: float) -> Felt:
        """To a depth at once, mm; negative pulls."""
        began = time.perf_counter()
        self.answer = self.session.press(depth)
        self.milliseconds = 1000.0 * (time.perf_counter() - began)
        self.depth = self.answer.indentation_mm
        if self.answer.ok:
            self.rows.append(self._row(self.answer))
        return self.facts()

    def press(self, depth: float) -> Felt:
        """To a depth, mm, in small steps, each of which is part of the curve. Raises InputError before a touch."""
        if not math.isfinite(depth):
            raise InputError(f"{depth} mm is no depth")
        depth = float(np.clip(depth, -self.session.deepest, self.session.deepest))
        steps = max(1, math.ceil(abs(depth - self.depth) / PRESS_STEP - 1e-9))
        found = self.facts()
        for goal in np.linspace(self.depth, depth, steps + 1)[1:]:
            found = self.go(float(goal))
            if not found["ok"]:
                break
        return found

    def slide(self, point: FloatArray, at_once: bool = False) -> Felt:
        """Along the surface at rest to where it is nearest to a point (3,) mm, at the present depth. Raises InputError before a touch."""
        at = self.session.at
        if at is None:
            raise InputError("the probe touches nothing yet; touch a point first")
        way = np.asarray(point, dtype=float) - at.point
        steps = 1 if at_once else max(1, math.ceil(float(np.linalg.norm(way)) / SLIDE_STEP))
        found = self.facts()
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            self.session.slide(at.point + share * way)
            found = self.go(self.depth)
        return found

    def resize(self, radius: float) -> Felt:
        """Another probe, mm; the curve so far is kept."""
        self.session.take(radius)
        self.answer, self.depth = None, 0.0
        return self.facts()

    def forget(self) -> Felt:
        """The curve begins anew."""
        self.session.answers.clear()
        self.rows = []
        return self.facts()

    def save(self, path: Path) -> Saved:
        """Writes the curve as PATH.csv and PATH.png. Raises InputError when nothing has been felt yet."""
        rows = self.rows
        if not rows:
            raise InputError("nothing has been pressed or pulled yet; there is no curve to save")
        files = [path.with_name(path.name + ending) for ending in (".csv", ".png")]
        files[0].parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(files[0]) as part:
            part.write_text(curve_csv(rows), encoding="utf-8")
        with atomic_path(files[1]) as part:
            force_curve(rows, self.stiffness(), self.support).savefig(part, dpi=_DPI, format="png")
        return {**self.facts(), "files": [str(file) for file in files]}

    @property
    def support(self) -> str:
        """What holds the organ."""
        return self.session.body.support

    def stiffness(self) -> dict[str, str]:
        """G of each region by its name, in words."""
        body = self.session.body
        return {name: stiffness_words(body.shear_kpa[r], body.interval_kpa.get(r)) for r, name in body.names.items()}

    def _row(self, a: Answer) -> CurveRow:
        x, y, z = map(float, a.point)
        return CurveRow(
            touch=a.touch, region=self.session.body.names[a.region], point=(x, y, z), probe_radius_mm=a.radius,
            indentation_mm=a.indentation_mm, force_n=a.force_n, stiffness_n_per_mm=a.stiffness_n_per_mm, error_n=a.error_n,
            solve="full" if a.full else "quick",
        )  # fmt: skip

    def facts(self) -> Felt:
        """What is felt now, ready for JSON."""
        answers, radius = len(self.session.answers), self.session.radius
        a = self.answer
        if a is None:
            return {"answers": answers, "probe_radius_mm": radius, "region": None, "indentation_mm": 0.0, "force_n": 0.0,
                    "stiffness_n_per_mm": None, "ok": True}  # fmt: skip
        return {
            "answers": answers, "probe_radius_mm": radius, "touch": a.touch, "region": self.session.body.names[a.region],
            "G_kpa": self.session.body.shear_kpa[a.region], "G_ci95_kpa": self.session.body.interval_kpa.get(a.region),
            "point": [round(float(c), 3) for c in a.point], "normal": [round(float(c), 5) for c in a.normal],
            "indentation_mm": round(a.indentation_mm, 4), "force_n": round(a.force_n, 6),
            "stiffness_n_per_mm": a.stiffness_n_per_mm, "error_n": a.error_n, "solve": "full" if a.full else "quick",
            "ok": a.ok, "said": a.reason, "milliseconds": round(self.milliseconds, 2),
        }  # fmt: skip
