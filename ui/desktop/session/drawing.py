"""Shapes while they are drawn on a slice: ruler, angle, regions of the map, lasso and polygon of a label."""

from __future__ import annotations

import numpy as np

from palpate.core.errors import InputError
from palpate.ui.desktop.session.editing import Editing
from palpate.ui.desktop.session.measuring import Measuring
from palpate.ui.desktop.session.session import Session
from palpate.ui.pictures.planes import Plane
from palpate.ui.report.measured_regions import area_mm2

Point = tuple[float, float, float]
# Tool -> kind of measurement.
MEASURES = {"ruler": "distance", "angle": "angle", "ellipse": "ellipse", "region": "region"}
OUTLINES = ("lasso", "polygon")
SHAPES = (*MEASURES, *OUTLINES)
CLICKED = ("angle", "polygon")
_ANGLE_POINTS, _ELLIPSE_POINTS = 3, 64
# Less was a click, not a drag.
_LEAST_MM, _LEAST_MM2 = 0.5, 1.0


class Drawing:
    """tool, plane, state : of the shape that is begun. points : clicked or dragged so far, mm LPS."""

    def __init__(self, session: Session, editing: Editing, measuring: Measuring) -> None:
        self._session, self._editing, self._measuring = session, editing, measuring
        self.reset()

    def reset(self) -> None:
        """Forgets a shape that was begun."""
        self.tool, self.state, self.points = "", "rest", list[Point]()
        self.plane: Plane | None = None
        self._erase = False

    @property
    def outline(self) -> list[Point]:
        """The shape as far as it is drawn; an ellipse as its outline."""
        if self.tool == "ellipse" and len(self.points) == 2 and self.plane is not None:
            return ellipse(self.plane, self.points[0], self.points[1])
        return self.points

    def press(self, tool: str, state: str, plane: Plane, point: Point, erase: bool = False) -> None:
        """The button goes down. Raises InputError when that cannot be drawn here."""
        reason = (
            self._editing.why_not() if tool in OUTLINES else self._measuring.why_not(MEASURES.get(tool, tool), state)
        )
        if reason:
            raise InputError(reason)
        goes_on = tool in CLICKED and (tool, state, plane) == (self.tool, self.state, self.plane)
        if not goes_on or abs(point[plane.normal] - self.points[0][plane.normal]) > _LEAST_MM:
            self.reset()
            self.tool, self.state, self.plane, self._erase = tool, state, plane, erase
        self.points.append(point)
        if tool == "angle" and len(self.points) == _ANGLE_POINTS:
            self._finish()
        self._session.notify("drawn")

    def move(self, point: Point) -> None:
        """The pointer moves with the button down."""
        if not self.points or self.tool in CLICKED:
            return
        if self.tool in ("ruler", "ellipse"):
            self.points[1:] = [point]
        else:
            self.points.append(point)
        self._session.notify("drawn")

    def release(self) -> None:
        """The button goes up: a dragged shape is done. Raises InputError as `close`."""
        if self.tool and self.tool not in CLICKED:
            self._finish()
            self._session.notify("drawn")

    def close(self) -> None:
        """A polygon is done. Raises InputError when it cannot be taken."""
        if self.tool == "polygon":
            self._finish()
            self._session.notify("drawn")

    def _finish(self) -> None:
        tool, state, plane, points, erase = self.tool, self.state, self.plane, tuple(self.outline), self._erase
        self.reset()
        if plane is None or not _is_drawn(tool, plane, points):
            return
        if tool in OUTLINES:
            self._editing.fill(state, plane, points, erase)
        else:
            self._measuring.add(MEASURES[tool], plane.name, points)


def _is_drawn(tool: str, plane: Plane, points: tuple[Point, ...]) -> bool:
    if tool == "angle":
        return True
    if tool == "ruler":
        return len(points) == 2 and float(np.linalg.norm(np.subtract(*points))) >= _LEAST_MM
    return len(points) > 2 and area_mm2(plane, points) >= _LEAST_MM2


def ellipse(plane: Plane, first: Point, last: Point) -> list[Point]:
    """Outline of the ellipse in the box between two corners of a slice."""
    centre, half = np.add(first, last) / 2.0, np.subtract(last, first) / 2.0
    out = np.tile(centre, (_ELLIPSE_POINTS, 1))
    turn = np.linspace(0.0, 2.0 * np.pi, _ELLIPSE_POINTS, endpoint=False)
    out[:, plane.across] += half[plane.across] * np.cos(turn)
    out[:, plane.down] += half[plane.down] * np.sin(turn)
    return [(float(x), float(y), float(z)) for x, y, z in out]
