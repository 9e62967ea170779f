"""What a person points at: a click, six extreme points, or a box around an organ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.core.errors import InputError
from palpate.core.surfaces.rigid_motion import transformed
from palpate.imaging.volume import Volume

_HOW_MANY = {1: "give one point", 2: "give two points", 6: "give six points"}
SEED_NAMES = ("prostate", "bladder", "rectum", "urethra")
ORGANS = ("prostate", "bladder", "rectum")


@dataclass(frozen=True)
class Prompts:
    """Points in patient coordinates, LPS mm.

    seeds : name -> (3,) a point inside the organ, or on the urethra. extremes : organ -> (6, 3) its outermost points in
    any order. boxes : organ -> (2, 3) lowest and highest corner. spread_mm : organ -> standard deviation of a seed that
    nobody clicked on: it was carried over from the other state.
    """

    seeds: Mapping[str, FloatArray] = field(default_factory=dict)
    extremes: Mapping[str, FloatArray] = field(default_factory=dict)
    boxes: Mapping[str, FloatArray] = field(default_factory=dict)
    spread_mm: Mapping[str, float] = field(default_factory=dict)

    def mode(self, organ: str) -> str:
        """Which prompt an organ has: "extremes", "box", "click", "carried" or "auto"; the most telling one."""
        if organ in self.extremes:
            return "extremes"
        if organ in self.boxes:
            return "box"
        if organ in self.spread_mm:
            return "carried"
        return "click" if organ in self.seeds else "auto"

    def box(self, organ: str) -> FloatArray | None:
        """Lowest and highest corner (2, 3) mm of an organ that has extreme points or a box."""
        if organ in self.extremes:
            return np.array([self.extremes[organ].min(axis=0), self.extremes[organ].max(axis=0)])
        return self.boxes.get(organ)

    def point(self, organ: str) -> FloatArray | None:
        """A point inside an organ that has a prompt: the click, or the middle of the box."""
        box = self.box(organ)
        return self.seeds.get(organ) if box is None else np.asarray(box.mean(axis=0))

    def without(self, organ: str) -> Prompts:
        """These prompts but for one organ's."""
        seeds, extremes, boxes = (
            {name: value for name, value in group.items() if name != organ}
            for group in (self.seeds, self.extremes, self.boxes)
        )
        return Prompts(seeds, extremes, boxes, {name: sd for name, sd in self.spread_mm.items() if name != organ})

    def or_near(self, points: Mapping[str, FloatArray], spread_mm: float) -> Prompts:
        """These prompts, and a vague seed near each point (3,) mm of an organ that has none."""
        new = {name: point for name, point in points.items() if self.mode(name) == "auto"}
        spreads = {**self.spread_mm, **dict.fromkeys(new, spread_mm)}
        return replace(self, seeds={**self.seeds, **new}, spread_mm=spreads)

    def moved(self, transform: FloatArray) -> Prompts:
        """The prompts carried by a rigid transform (4, 4). A box becomes the box around its moved corners."""
        return Prompts(
            {name: transformed(transform, point[None])[0] for name, point in self.seeds.items()},
            {name: transformed(transform, points) for name, points in self.extremes.items()},
            {name: _box_around(transform, box) for name, box in self.boxes.items()},
            self.spread_mm,
        )

    def to_dict(self) -> dict[str, dict[str, list[float]]]:
        """JSON-able form, for hashes and reports."""
        groups = {"seeds": self.seeds, "extremes": self.extremes, "boxes": self.boxes}
        return {key: {name: np.asarray(v).tolist() for name, v in group.items()} for key, group in groups.items()}


def parse_prompts(
    seeds: Sequence[str] = (), extremes: Sequence[str] = (), boxes: Sequence[str] = (), option: str = "--seed"
) -> Prompts:
    """Prompts of the command line: ``prostate=x,y,z``, ``prostate=x1,y1,z1;...;x6,y6,z6``, ``bladder=x1,y1,z1;x2,y2,z2``.

    Raises InputError naming the option, what is wrong and the form it must have.
    """
    points = {k: v[0] for k, v in _parsed(seeds, option, SEED_NAMES, 1).items()}
    corners = {
        name: np.array([box.min(axis=0), box.max(axis=0)]) for name, box in _parsed(boxes, "--box", ORGANS, 2).items()
    }
    return Prompts(points, _parsed(extremes, "--extremes", ORGANS, 6), corners)


def _parsed(texts: Sequence[str], option: str, names: Sequence[str], count: int) -> dict[str, FloatArray]:
    form = ";".join(["x,y,z"] * count) if count < 3 else "x1,y1,z1;...;x6,y6,z6"
    result: dict[str, FloatArray] = {}
    for text in texts:
        name, _, rest = text.partition("=")
        if name not in names:
            raise InputError(
                f"{option} {text}: {name!r} is not one of {', '.join(names)}; write NAME={form} in mm, LPS"
            )
        try:
            values = np.array([[float(x) for x in point.split(",")] for point in rest.split(";")])
        except ValueError as error:
            raise InputError(f"{option} {text}: not numbers; write {name}={form} in mm, LPS") from error
        if values.shape != (count, 3) or not np.isfinite(values).all():
            raise InputError(f"{option} {text}: {_HOW_MANY[count]} of 3 numbers; write {name}={form} in mm, LPS")
        if count > 1 and np.ptp(values, axis=0).min() < 2.0:
            raise InputError(f"{option} {text}: the points span less than 2 mm in one direction; correct them")
        result[name] = values
    return result


def check_inside(scan: Volume, prompts: Prompts, state: str) -> None:
    """Raises InputError for a point that lies outside a scan: its coordinates are another scan's, or not LPS."""
    clicked = {name: point[None] for name, point in prompts.seeds.items() if name not in prompts.spread_mm}
    given = {**clicked, **prompts.extremes}
    corners = np.array(list(product(*((-0.5, n - 0.5) for n in scan.array.shape))))
    places = scan.to_lps(corners)
    reach = ", ".join(
        f"{a} {low:.0f} to {high:.0f}" for a, low, high in zip("xyz", places.min(0), places.max(0), strict=True)
    )
    for name, points in given.items():
        index = scan.to_index(np.asarray(points, dtype=float))
        if not ((index > -0.5) & (index < np.array(scan.array.shape) - 0.5)).all():
            raise InputError(
                f"the point given for {name} lies outside the {state} scan ({reach}); give patient coordinates, LPS in mm"
            )


def _box_around(transform: FloatArray, box: FloatArray) -> FloatArray:
    corners = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    moved = transformed(transform, corners)
    return np.array([moved.min(axis=0), moved.max(axis=0)])
