"""Sides of a figure that do not move through all keyframes."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.applications.sketch.figure import held_points
from palpate.applications.sketch.outline import Outline
from palpate.applications.sketch.sides import SIDES

# A side is held when this share of its rim (_MOST) lies within _STAYS of every keyframe's line, in figure sizes. Points
# within _CORNER of a side that is held already are left out: they say nothing of the next side.
_STAYS, _MOST, _CORNER = 0.02, 0.9, 0.1


def sides_that_stay(rest: Outline, keys: Sequence[Outline]) -> tuple[str, ...]:
    """Names of the sides of the first keyframe's box whose rim is in the same place in every other keyframe."""
    stays: list[str] = []
    for side in SIDES:
        own = held_points(rest.points, rest, (side,)) & ~held_points(rest.points, rest, tuple(stays), _CORNER)
        rim = rest.points[own]
        if len(rim) and all((key.distances(rim) < _STAYS * rest.size).mean() > _MOST for key in keys):
            stays.append(side)
    return tuple(stays)
