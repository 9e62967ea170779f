"""A body in two states as a simulator leaves it: the label of every point, and how every point moved."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from palpate.core.arrays import FloatArray, LabelArray
from palpate.imaging.volume import Volume

Labels = Callable[[FloatArray], LabelArray]
Points = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, eq=False)
class TwoStates:
    """Two states of one body, in one frame, mm.

    rest : points (n, 3) -> labels (n,) at rest, 0 outside the modelled region. to_rest : points (n, 3) of the deformed body -> where
    they were at rest. displacement : points (n, 3) at rest on or in the organ, or on a wall -> how they moved (n, 3). low, high : (3,)
    corners of a box that holds the modelled region in both states. G : organ label -> shear modulus, kPa.
    """

    rest: Labels
    to_rest: Points
    displacement: Points
    low: FloatArray
    high: FloatArray
    G: Mapping[int, float]

    def deformed(self, points: FloatArray) -> LabelArray:
        """Labels (n,) of points (n, 3) mm in the deformed state."""
        return self.rest(self.to_rest(points))

    def labels(self, state: str) -> Labels:
        """Labels of a state, "rest" or "deformed"."""
        return self.rest if state == "rest" else self.deformed

    def grid(self, voxel_mm: tuple[float, float, float]) -> Volume:
        """An empty grid of such voxels over the box, a voxel wider on every side."""
        spacing = np.array(voxel_mm)
        return Volume.upright(self.low - spacing, spacing, np.ceil((self.high - self.low) / spacing) + 3)
