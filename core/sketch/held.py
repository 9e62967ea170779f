"""Which sides of a figure stay where they are through all keyframes."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.core.sketch.figure import SIDES, held_points
from palpate.core.sketch.outline import Outline

# A side stays when nine tenths of its rim are no further than this from every keyframe's line, in figure sizes.
_STAYS, _MOST = 0.02, 0.9


def sides_that_stay(rest: Outline, keys: Sequence[Outline]) -> tuple[str, ...]:
    """Names of the sides of the first keyframe's box whose rim every other keyframe (in the same frame) shows in the same place."""
    stays = []
    for side in SIDES:
        rim = rest.points[held_points(rest.points, rest, (side,))]
        if all((key.distances(rim) < _STAYS * rest.size).mean() > _MOST for key in keys):
            stays.append(side)
    return tuple(stays)
