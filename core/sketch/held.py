"""Which sides of a figure stay where they are through all keyframes."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.core.sketch.figure import SIDES, held_points
from palpate.core.sketch.outline import Outline

# A side stays when nine tenths of its rim are no further than this from every keyframe's line, in figure sizes. A corner that it
# shares with a side that stays, so far, says nothing of it.
_STAYS, _MOST, _CORNER = 0.02, 0.9, 0.1


def sides_that_stay(rest: Outline, keys: Sequence[Outline]) -> tuple[str, ...]:
    """Names of the sides of the first keyframe's box whose rim every other keyframe (in the same frame) shows in the same place."""
    stays: list[str] = []
    for side in SIDES:
        own = held_points(rest.points, rest, (side,)) & ~held_points(rest.points, rest, tuple(stays), _CORNER)
        rim = rest.points[own]
        if len(rim) and all((key.distances(rim) < _STAYS * rest.size).mean() > _MOST for key in keys):
            stays.append(side)
    return tuple(stays)
