"""Where the middle of a rectum runs that six points are given of: the straightest line that agrees with all six."""

from __future__ import annotations

import numpy as np

from palpate.core.arrays import FloatArray
from palpate.segmentation.rectum.outlines import ANGLES, USUAL_MM, Track

# How far a point may be off, mm, and a usual radius, mm. How sharply the line may bend: the spread of the change of its slope
# over one mm of height; so it turns by half a radian over 40 mm, as flexures do.
POINT_MM, USUAL_SD_MM, BEND = 2.0, 4.0, 0.08
# Radius at the lower end, the anal canal, and at the upper one, where the sigmoid begins: half of 18 and of 26 mm.
CANAL_MM, SIGMOID_MM = 9.0, 13.0


def guide_of(points: FloatArray, heights: FloatArray) -> Track:
    """A tube at given heights (n,) mm, rising, through six outermost points (6, 3) mm in any order.

    The lowest and highest point lie on its middle line, the others one radius beside it. Line and radius are found by least
    squares against bending, so that the line stays smooth where points are off. The tube is widest half-way up and
    narrows, as a parabola, to the usual radius of either end.
    """
    low, high = points[points.argmin(axis=0)], points[points.argmax(axis=0)]
    sides = [low[:2], high[:2]]
    centres = np.empty((len(heights), 2))
    radii = []
    for axis in range(2):
        other = 1 - axis
        on_line = [(p[2], p[axis]) for p in (low[2], high[2])]
        # The points that are outermost across the other axis lie on the line as seen along it.
        on_line += [(side[other][2], side[other][axis]) for side in sides]
        beside = [(side[axis][2], side[axis][axis], sign) for side, sign in zip(sides, (1.0, -1.0), strict=True)]
        profile = _profile(np.array([z for z, _, _ in beside]), low[2, 2], high[2, 2])
        centres[:, axis], radius = _line(heights, on_line, beside, profile)
        radii.append(radius)
    ends, wide = _profile(heights, low[2, 2], high[2, 2])
    across = ends + wide * float(np.mean(radii))
    return Track(heights, centres, np.repeat(across[:, None], ANGLES, axis=1))


def _profile(z: FloatArray, low: float, high: float) -> tuple[FloatArray, FloatArray]:
    """The radius (n,) at heights is the first of these plus the second times the tube's largest radius."""
    share = np.clip((z - low) / (high - low), 0.0, 1.0)
    wide = 1.0 - (2.0 * share - 1.0) ** 2
    return (1.0 - wide) * (CANAL_MM + share * (SIGMOID_MM - CANAL_MM)), wide


def _line(
    heights: FloatArray,
    on_line: list[tuple[float, float]],
    beside: list[tuple[float, float, float]],
    profile: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, float]:
    """Places (n,) mm of the middle line along one axis, and the largest radius.

    on_line : height and place of points on it. beside : height and place of points on the wall, and on which side the
    middle lies of them. profile : how the radius at these follows from the largest one.
    """
    n, step = len(heights), float(heights[1] - heights[0])
    rows, right = [], []
    for z, place in on_line:
        rows.append(np.append(_at(heights, z), 0.0) / POINT_MM)
        right.append(place / POINT_MM)
    for (z, place, sign), end, wide in zip(beside, *profile, strict=True):
        rows.append(np.append(_at(heights, z), -sign * wide) / POINT_MM)
        right.append((place + sign * end) / POINT_MM)
    rows.append(np.append(np.zeros(n), 1.0) / USUAL_SD_MM)
    right.append(USUAL_MM / USUAL_SD_MM)
    bend = np.diff(np.eye(n), n=2, axis=0) / (BEND * step**1.5)
    matrix = np.vstack([np.array(rows), np.hstack([bend, np.zeros((n - 2, 1))])])
    found = np.linalg.lstsq(matrix, np.concatenate([right, np.zeros(n - 2)]), rcond=None)[0]
    return found[:-1], float(found[-1])


def _at(heights: FloatArray, z: float) -> FloatArray:
    """Weights (n,) that interpolate at a height."""
    weights = np.zeros(len(heights))
    place = float(np.clip((z - heights[0]) / (heights[1] - heights[0]), 0.0, len(heights) - 1.0))
    k = min(int(place), len(heights) - 2)
    weights[k], weights[k + 1] = k + 1 - place, place - k
    return weights
