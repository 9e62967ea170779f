"""Closed outlines in the plane: loops, distances with a side, nearest points that look the same way."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.core.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Outline:
    """The rim of a plane figure.

    loops : each (n, 2) mm, closed without repeating its first point; the outer one first, counter-clockwise, holes
    clockwise, so that the figure lies on the left.
    """

    loops: tuple[FloatArray, ...]

    @cached_property
    def points(self) -> FloatArray:
        """(n, 2) mm of all loops."""
        return np.vstack(self.loops)

    @cached_property
    def following(self) -> IntArray:
        """(n,) index of the next point of the same loop."""
        parts, start = [], 0
        for loop in self.loops:
            parts.append(start + (np.arange(len(loop)) + 1) % len(loop))
            start += len(loop)
        return np.concatenate(parts)

    @cached_property
    def normals(self) -> FloatArray:
        """(n, 2) unit outward normals of the segments that begin at each point."""
        along = self.points[self.following] - self.points
        length = np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
        return np.column_stack([along[:, 1], -along[:, 0]]) / length

    @property
    def size(self) -> float:
        """The larger extent of the outer loop, mm."""
        return float(np.ptp(self.loops[0], axis=0).max())

    @property
    def length(self) -> float:
        """Of all loops, mm."""
        return float(np.linalg.norm(self.points[self.following] - self.points, axis=1).sum())

    @property
    def area(self) -> float:
        """Without the holes, mm2."""
        return sum(signed_area(loop) for loop in self.loops)

    def resampled(self, spacing: float) -> Outline:
        """The same rim with points about `spacing` mm apart, at least eight a loop."""
        return Outline(tuple(resampled_loop(loop, max(8, round(perimeter(loop) / spacing))) for loop in self.loops))

    def nearest(self, x: FloatArray, normals: FloatArray | None = None) -> tuple[IntArray, FloatArray, FloatArray]:
        """For x (q, 2): the segment (q,) that is nearest, how far along it (q,) 0 to 1, and the point (q, 2).

        normals : (q, 2) outward normals at x; then only segments that look to the same side count, so that the two
        sides of a thin limb are not taken for each other.
        """
        a, ab = self.points, self.points[self.following] - self.points
        squared = np.maximum((ab**2).sum(axis=1), 1e-300)
        share = np.clip(np.einsum("qsi,si->qs", x[:, None] - a, ab) / squared, 0.0, 1.0)
        distance = ((a + share[:, :, None] * ab - x[:, None]) ** 2).sum(axis=2)
        if normals is not None:
            agrees = normals @ self.normals.T > 0.0
            distance = np.where(agrees | ~agrees.any(axis=1, keepdims=True), distance, np.inf)
        segment = np.argmin(distance, axis=1)
        along = share[np.arange(len(x)), segment]
        return segment, along, a[segment] + along[:, None] * ab[segment]

    def distances(self, x: FloatArray) -> FloatArray:
        """(q,) mm of points (q, 2) from the rim."""
        return np.linalg.norm(x - self.nearest(x)[2], axis=1)


def signed_area(loop: FloatArray) -> float:
    """mm2, positive where the loop (n, 2) goes counter-clockwise."""
    x, y = loop.T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


def perimeter(loop: FloatArray) -> float:
    """mm of a closed loop (n, 2)."""
    return float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum())


def resampled_loop(loop: FloatArray, count: int) -> FloatArray:
    """`count` points (count, 2) at equal steps along a closed loop, its first point kept."""
    closed = np.vstack([loop, loop[:1]])
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.arange(count) * way[-1] / count
    return np.column_stack([np.interp(at, way, closed[:, k]) for k in range(2)])


def hausdorff(a: Outline, b: Outline) -> float:
    """Two-sided Hausdorff distance, mm, of the outlines' points from the other's rim (paper Eq 10, both ways)."""
    return float(max(b.distances(a.points).max(), a.distances(b.points).max()))
